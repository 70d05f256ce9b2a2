// Packs a node of the top level. Binds nothing; uses the variables `top_pass`, `clusters` and
// `nodes` of the stage.

// The clusters of nodes that this workgroup has packed: other invocations of this dispatch may not see
// what one of them writes to `clusters`.
var<workgroup> pack_clusters: array<LightCluster, TOP_HELD>;
// For each such node the three words of its `MaskShares`.
var<workgroup> pack_shares: array<u32, 3u * TOP_HELD>;
// For each such node its name.
var<workgroup> pack_names: array<u32, TOP_HELD>;
// The name of each invocation's child, mixed with its slot.
var<workgroup> pack_child_names: array<u32, TOP_NODE_LANES>;

// The value of `held` for a child that this workgroup has not packed.
const NODE_STORED: u32 = 0xffffffffu;

// A child of a node that is packed.
struct NodeChild {
    // LIGHT_EMPTY_SLOT, LIGHT_LEAF with the number of a part, or a node.
    bits: u32,
    // The place of its cluster in pack_clusters, or NODE_STORED.
    held: u32,
}

const NODE_NO_CHILD = NodeChild(LIGHT_EMPTY_SLOT, NODE_STORED);

fn node_cluster(child: NodeChild) -> LightCluster {
    if child.bits == LIGHT_EMPTY_SLOT {
        return CLUSTER_EMPTY;
    }
    if (child.bits & LIGHT_LEAF) != 0u {
        return clusters[child.bits & ~LIGHT_LEAF];
    }
    if child.held != NODE_STORED {
        return pack_clusters[child.held];
    }
    return clusters[top_pass.capacity + child.bits];
}

// The child bits of the leaf that is a part. Twin of `Part::leaf`.
fn node_leaf(part: u32) -> u32 {
    let below = nodes[top_part(part) + 1u];
    if below == 0u {
        return LIGHT_LEAF | nodes[top_part(part)];
    }
    return LIGHT_LEAF | LIGHT_PART | select(0u, LIGHT_SINGLE, (below & LIGHT_LEAF) != 0u) | part;
}

// The bits of a child as they are stored.
fn node_child_bits(child: NodeChild) -> u32 {
    if child.bits != LIGHT_EMPTY_SLOT && (child.bits & LIGHT_LEAF) != 0u {
        return node_leaf(child.bits & ~LIGHT_LEAF);
    }
    return child.bits;
}

// Tells children apart: the bits of leaves and of nodes that last. A run has the name of its children.
fn node_child_name(child: NodeChild, bits: u32) -> u32 {
    if child.bits != LIGHT_EMPTY_SLOT && (child.bits & LIGHT_LEAF) == 0u && child.bits >= top_pass.runs {
        return pack_names[child.held];
    }
    return bits;
}

// The `MaskShares` of a child.
fn node_shares(child: NodeChild) -> vec3<u32> {
    if child.bits == LIGHT_EMPTY_SLOT {
        return vec3(0u);
    }
    if (child.bits & LIGHT_LEAF) != 0u {
        return vec3(nodes[top_part(child.bits & ~LIGHT_LEAF) + 3u]);
    }
    if child.held != NODE_STORED {
        let at = 3u * child.held;
        return vec3(pack_shares[at], pack_shares[at + 1u], pack_shares[at + 2u]);
    }
    let at = top_masks(child.bits);
    return vec3(nodes[at], nodes[at + 1u], nodes[at + 2u]);
}

// Packs a node whose parent's place is `parent`, and holds its cluster at `held`. Writes into each part where its
// leaf is, and into each node that was packed by an earlier dispatch the place of its parent. The tail of a node
// has its parent, 0, and its name, which changes with its children. Twin of `Build::pack` in src/top/mod.rs. Eight
// neighbouring invocations pack a node, one for each child; those without a node have `is_used` false. Call from
// uniform control flow.
fn node_pack(lane: u32, node: u32, parent: u32, is_used: bool, child: NodeChild, held: u32) {
    let slot = lane % LIGHT_WIDTH;
    let first = lane - slot;
    let place = node * LIGHT_WIDTH + slot;
    if top_pass.masks != 0u {
        // First, while few registers are in use.
        pack_masks(lane, node, is_used, child, held);
    }
    let cluster = node_cluster(child);
    let merged = pack_merged(lane, cluster, cluster.flux);
    if is_used {
        let bits = vec3(
            step_bits(merged.box_min.x, merged.box_max.x),
            step_bits(merged.box_min.y, merged.box_max.y),
            step_bits(merged.box_min.z, merged.box_max.z),
        );
        if slot == 0u {
            node_store(node, merged.box_min, bits, parent);
            let finished = pack_finished(first, merged, pack_between(first, merged));
            clusters[top_pass.capacity + node] = finished;
            pack_clusters[held] = finished;
        }
        node_store_child(place, child_packed(cluster, merged.box_min, bits));
        if child.bits != LIGHT_EMPTY_SLOT {
            if (child.bits & LIGHT_LEAF) != 0u {
                nodes[top_part(child.bits & ~LIGHT_LEAF) + 2u] = place;
            } else if child.held == NODE_STORED {
                node_store_parent(child.bits, place);
            }
        }
        let child_bits = node_child_bits(child);
        node_store_child_bits(place, child_bits);
        pack_child_names[lane] = light_hash(node_child_name(child, child_bits) ^ light_hash(slot));
    }
    // The words may be written again, and the cluster is read.
    workgroupBarrier();
    if is_used && slot == 0u {
        var name = 0u;
        for (var i = 0u; i < LIGHT_WIDTH; i++) {
            name += pack_child_names[first + i];
        }
        pack_names[held] = name;
        nodes[node_tail_word(node) + 2u] = name;
    }
}

// Twin of `weights` in src/top/masks.rs; `greatest` is the greatest flux of the eight.
fn pack_weight(flux: u32, greatest: u32) -> u32 {
    let mantissa = (128u | (flux & 127u)) << 4u;
    return select(max(mantissa >> min((greatest >> 7u) - (flux >> 7u), 12u), 1u), 0u, flux == 0u);
}

// Twin of `nearest_code` in src/top/masks.rs.
fn pack_code(sum: u32, total: u32) -> u32 {
    if sum == 0u {
        return 0u;
    }
    var code = 7u;
    while code > 1u && 256u * sum < TOP_MASK_ROUNDED * ((1u << code) >> 1u) * total {
        code--;
    }
    return code;
}

// Stores the `NodeMasks` of a node. The arguments are as for node_pack. Twin of `MaskShares::merged`.
// Call from uniform control flow.
fn pack_masks(lane: u32, node: u32, is_used: bool, child: NodeChild, held: u32) {
    let slot = lane % LIGHT_WIDTH;
    let first = lane - slot;
    var flux = 0u;
    var shares = vec3(0u);
    if is_used {
        flux = pack_half(node_cluster(child).flux, 0x8000u);
        shares = node_shares(child);
        nodes[top_masks(node) + 4u + slot] = shares.x | shares.y | shares.z;
    }
    for (var j = 0u; j < 3u; j++) {
        pack_words[pack_word(j, lane)] = shares[j];
    }
    pack_words[pack_word(3u, lane)] = flux;
    workgroupBarrier();
    var greatest = 0u;
    for (var child = 0u; child < LIGHT_WIDTH; child++) {
        greatest = max(greatest, pack_words[pack_word(3u, first + child)]);
    }
    // Each of the eight invocations finds the codes of four bits.
    var sums = vec4(0u);
    var total = 0u;
    for (var child = 0u; child < LIGHT_WIDTH; child++) {
        var child_codes = vec4(0u);
        for (var j = 0u; j < 3u; j++) {
            let word = pack_words[pack_word(j, first + child)] >> (4u * slot);
            child_codes |= ((vec4(word) >> vec4(0u, 1u, 2u, 3u)) & vec4(1u)) << vec4(j);
        }
        let weight = pack_weight(pack_words[pack_word(3u, first + child)], greatest);
        sums += weight * ((vec4(1u) << child_codes) >> vec4(1u));
        total += weight;
    }
    var codes = 0u;
    for (var i = 0u; i < 4u; i++) {
        codes |= pack_code(sums[i], total) << (4u * i);
    }
    pack_results[lane] = codes;
    workgroupBarrier();
    if is_used && slot < 3u {
        var word = 0u;
        for (var child = 0u; child < LIGHT_WIDTH; child++) {
            let bits = (pack_results[first + child] >> slot) & 0x1111u;
            word |= ((bits | (bits >> 3u) | (bits >> 6u) | (bits >> 9u)) & 15u) << (4u * child);
        }
        nodes[top_masks(node) + slot] = word;
        pack_shares[3u * held + slot] = word;
    }
    // The words may be written again.
    workgroupBarrier();
}

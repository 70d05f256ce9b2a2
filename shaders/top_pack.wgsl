// Packs a node of the top level. Binds nothing; uses the variables `top_pass`, `clusters` and
// `nodes` of the stage.

// The cluster of each node of the piece that is packed already.
var<workgroup> pack_clusters: array<LightCluster, TOP_MAX_NODES>;
// For each such node the three words of its `MaskShares`.
var<workgroup> pack_shares: array<u32, 3u * TOP_MAX_NODES>;

// The cluster of a child. Nodes of the same piece, which begin at `first`, have theirs in workgroup
// memory: other invocations of this dispatch may not see what one of them writes to `clusters`.
fn node_child(child_bits: u32, first: u32) -> LightCluster {
    if child_bits == LIGHT_EMPTY_SLOT {
        return CLUSTER_EMPTY;
    }
    if (child_bits & LIGHT_LEAF) != 0u {
        return clusters[child_bits & ~LIGHT_LEAF];
    }
    let in_piece = child_bits - first;
    if in_piece < TOP_MAX_NODES {
        return pack_clusters[in_piece];
    }
    return clusters[top_pass.capacity + child_bits];
}

// The child bits of the leaf that is a part. Twin of `Part::leaf`.
fn node_leaf(part: u32) -> u32 {
    let below = nodes[top_part(part) + 1u];
    if below == 0u {
        return LIGHT_LEAF | nodes[top_part(part)];
    }
    return LIGHT_LEAF | LIGHT_PART | select(0u, LIGHT_SINGLE, (below & LIGHT_LEAF) != 0u) | part;
}

// The `MaskShares` of a child.
fn node_shares(child_bits: u32, first: u32) -> vec3<u32> {
    if child_bits == LIGHT_EMPTY_SLOT {
        return vec3(0u);
    }
    if (child_bits & LIGHT_LEAF) != 0u {
        return vec3(nodes[top_part(child_bits & ~LIGHT_LEAF) + 3u]);
    }
    let in_piece = child_bits - first;
    if in_piece < TOP_MAX_NODES {
        let at = 3u * in_piece;
        return vec3(pack_shares[at], pack_shares[at + 1u], pack_shares[at + 2u]);
    }
    let at = top_masks(child_bits);
    return vec3(nodes[at], nodes[at + 1u], nodes[at + 2u]);
}

// Packs a node from the clusters of the children that its child bits name, and writes into each part
// where its leaf is. Twin of `WideCluster::merged` and `Node::pack`. Eight neighbouring invocations
// pack a node, one for each child; those without a node have `is_used` false. `piece` is the first
// node of the piece. Call from uniform control flow.
fn node_pack(lane: u32, node: u32, is_used: bool, piece: u32) {
    let stored = node_layout();
    let slot = lane % LIGHT_WIDTH;
    let first = lane - slot;
    let place = node * LIGHT_WIDTH + slot;
    var child_bits = LIGHT_EMPTY_SLOT;
    if is_used {
        child_bits = nodes[node_child_word(stored, place)];
    }
    if top_pass.masks != 0u {
        // First, while few registers are in use.
        pack_masks(lane, node, is_used, child_bits, piece);
    }
    let child = node_child(child_bits, piece);
    let merged = pack_merged(lane, child, child.flux);
    if is_used {
        let bits = vec3(
            step_bits(merged.box_min.x, merged.box_max.x),
            step_bits(merged.box_min.y, merged.box_max.y),
            step_bits(merged.box_min.z, merged.box_max.z),
        );
        if slot == 0u {
            let parent = nodes[node_tail_word(stored, node)];
            node_store(stored, node, merged.box_min, bits, parent);
            let finished = pack_finished(first, merged, pack_between(first, merged));
            clusters[top_pass.capacity + node] = finished;
            pack_clusters[node - piece] = finished;
        }
        node_store_child(stored, place, child_packed(child, merged.box_min, bits));
        if child_bits != LIGHT_EMPTY_SLOT && (child_bits & LIGHT_LEAF) != 0u {
            let part = child_bits & ~LIGHT_LEAF;
            nodes[top_part(part) + 2u] = place;
            node_store_child_bits(stored, place, node_leaf(part));
        }
    }
    // The words may be written again.
    workgroupBarrier();
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

// Stores the `NodeMasks` of a node. The arguments are as for node_pack, and the bits of a child. Twin of
// `MaskShares::merged`. Call from uniform control flow.
fn pack_masks(lane: u32, node: u32, is_used: bool, child_bits: u32, piece: u32) {
    let slot = lane % LIGHT_WIDTH;
    let first = lane - slot;
    var flux = 0u;
    var shares = vec3(0u);
    if is_used {
        flux = pack_half(node_child(child_bits, piece).flux, 0x8000u);
        shares = node_shares(child_bits, piece);
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
        pack_shares[3u * (node - piece) + slot] = word;
    }
    // The words may be written again.
    workgroupBarrier();
}

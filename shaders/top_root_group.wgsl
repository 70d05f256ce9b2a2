// Top level, the last stage but one: forms the upper part of the tree from the remaining units, by
// cost from the root down. A node has the index of the part that it holds; the root has index 0.
// Twin of `TopLevel::add_upper`. One workgroup.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> clusters: array<LightCluster>;
@group(0) @binding(2) var<storage, read_write> bounds: array<u32, 8>;
@group(0) @binding(3) var<storage, read_write> nodes: array<u32>;
@group(0) @binding(5) var<storage, read_write> order: array<u32>;
// From `units_after` on: for each part the depth of its node, 1 for the root; 0 if it has no node.
@group(0) @binding(6) var<storage, read_write> units: array<u32>;

// For each part: first | count << 9 | half << 18. `half` is the first of its two halves, and the
// other half is the part after that; it is 0 if the part was not split.
var<workgroup> root_parts: array<u32, TOP_ROOT_PARTS>;
var<workgroup> root_costs: array<u32, TOP_ROOT_PARTS>;
// Atomics, because one invocation writes the depths of a node's children while others search for
// nodes of the present depth.
var<workgroup> root_depths: array<atomic<u32>, TOP_ROOT_PARTS>;
// For each place the latest part that begins there.
var<workgroup> root_current: array<u32, TOP_PIECE>;
// The number of parts.
var<workgroup> root_count: u32;
// 1 once a node of the present depth has a child that is a node.
var<workgroup> root_has_deeper: atomic<u32>;
var<workgroup> root_is_done: u32;

// The places of a part.
fn root_part(part: u32) -> SplitPart {
    return SplitPart(root_parts[part] & 0x1ffu, (root_parts[part] >> 9u) & 0x1ffu);
}

// The first half of a part; 0 if it was not split.
fn root_half(part: u32) -> u32 {
    return root_parts[part] >> 18u;
}

// The bits of a part's cost that are compared.
fn root_cost(first: u32, count: u32) -> u32 {
    var sums = split_empty();
    for (var place = first; place < first + count; place++) {
        sums = split_add(sums, split_item(split_unit(place)));
    }
    return bitcast<u32>(split_cost(sums)) >> TOP_COST_SLACK;
}

// Records both halves of each part that was split, in the order of the parts.
fn split_record(lane: u32, parts: u32) {
    let known = workgroupUniformLoad(&root_count);
    if lane < parts {
        let first = split_heads[lane];
        let whole = root_current[first];
        let all = root_part(whole).count;
        let left = split_part(first).count;
        let half = known + 2u * lane;
        root_parts[whole] |= half << 18u;
        root_parts[half] = first | (left << 9u);
        root_parts[half + 1u] = (first + left) | ((all - left) << 9u);
        root_costs[half] = root_cost(first, left);
        root_costs[half + 1u] = root_cost(first + left, all - left);
        root_current[first] = half;
        root_current[first + left] = half + 1u;
    }
    if lane == 0u {
        root_count = known + 2u * parts;
    }
    workgroupBarrier();
}

// Finds the children of a node and writes its targets. Twin of `Children::choose`.
fn root_fill(whole: u32, depth: u32) {
    var children: array<u32, LIGHT_WIDTH>;
    var is_open: array<bool, LIGHT_WIDTH>;
    children[0] = whole;
    is_open[0] = root_part(whole).count <= LIGHT_WIDTH;
    var count = 1u;
    while count < LIGHT_WIDTH {
        var costliest = LIGHT_WIDTH;
        for (var i = 0u; i < count; i++) {
            if root_half(children[i]) != 0u {
                var is_more = costliest == LIGHT_WIDTH;
                if !is_more {
                    let a = children[i];
                    let b = children[costliest];
                    is_more = root_costs[a] > root_costs[b]
                        || (root_costs[a] == root_costs[b] && root_part(a).count > root_part(b).count);
                }
                if is_more {
                    costliest = i;
                }
            }
        }
        if costliest == LIGHT_WIDTH {
            break;
        }
        for (var i = count; i > costliest + 1u; i--) {
            children[i] = children[i - 1u];
        }
        let half = root_half(children[costliest]);
        children[costliest] = half;
        children[costliest + 1u] = half + 1u;
        count++;
    }
    var room = LIGHT_WIDTH - count;
    for (var turn = 0u; turn < count; turn++) {
        var smallest = LIGHT_WIDTH;
        for (var i = 0u; i < count; i++) {
            let size = root_part(children[i]).count;
            if !is_open[i] && size > 1u {
                var is_less = smallest == LIGHT_WIDTH;
                if !is_less {
                    is_less = size < root_part(children[smallest]).count;
                }
                if is_less {
                    smallest = i;
                }
            }
        }
        if smallest == LIGHT_WIDTH || root_part(children[smallest % LIGHT_WIDTH]).count > room + 1u {
            break;
        }
        room -= root_part(children[smallest]).count - 1u;
        is_open[smallest] = true;
    }
    var slot = 0u;
    for (var i = 0u; i < count; i++) {
        let part = root_part(children[i]);
        if is_open[i] || part.count == 1u {
            for (var place = part.first; place < part.first + part.count; place++) {
                // The first row of the words holds the numbers of the units now.
                root_target(whole, slot, gather_target(split_words[split_unit(place)]));
                slot++;
            }
        } else {
            atomicStore(&root_depths[children[i]], depth + 1u);
            atomicStore(&root_has_deeper, 1u);
            root_target(whole, slot, children[i]);
            slot++;
        }
    }
    for (; slot < LIGHT_WIDTH; slot++) {
        root_target(whole, slot, LIGHT_EMPTY_SLOT);
    }
}

// Writes the target of a child.
fn root_target(node: u32, slot: u32, bits: u32) {
    node_store_target(node_layout(), node * LIGHT_WIDTH + slot, bits);
}

@compute @workgroup_size(TOP_SPLIT_LANES)
fn top_root_group(@builtin(local_invocation_index) lane: u32) {
    split_clear_extremes(lane);
    for (var part = lane; part < TOP_ROOT_PARTS; part += TOP_SPLIT_LANES) {
        root_parts[part] = 0u;
        root_costs[part] = 0u;
        atomicStore(&root_depths[part], 0u);
    }
    for (var place = lane; place < TOP_PIECE; place += TOP_SPLIT_LANES) {
        root_current[place] = 0u;
    }
    // Its barriers come before the first extreme and the first part.
    let count = gather_count(lane);
    var own = 0u;
    if lane < count {
        own = gather_unit(lane);
        split_add_to_extremes(clusters[own]);
    }
    if lane == 0u {
        root_parts[0] = count << 9u;
        atomicStore(&root_depths[0], 1u);
        root_count = 1u;
    }
    workgroupBarrier();
    if lane < count {
        split_put(lane, clusters[own]);
    }
    split_all(lane, count);

    workgroupBarrier();
    split_words[lane] = own;
    for (var depth = 1u; depth <= TOP_ROOT_PARTS; depth++) {
        if lane == 0u {
            atomicStore(&root_has_deeper, 0u);
        }
        workgroupBarrier();
        for (var part = lane; part < TOP_ROOT_PARTS; part += TOP_SPLIT_LANES) {
            if atomicLoad(&root_depths[part]) == depth {
                root_fill(part, depth);
            }
        }
        workgroupBarrier();
        if lane == 0u {
            root_is_done = 1u - atomicLoad(&root_has_deeper);
        }
        if workgroupUniformLoad(&root_is_done) == 1u {
            break;
        }
    }
    for (var part = lane; part < TOP_ROOT_PARTS; part += TOP_SPLIT_LANES) {
        units[top_pass.units_after + part] = atomicLoad(&root_depths[part]);
    }
}

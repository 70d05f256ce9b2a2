// Top level, the last stages: packs the divided nodes of the partition, a block at a time, the deepest nodes
// of the block first. See src/top/stages.rs. Twin of `Build::unit`. One workgroup for each block.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> clusters: array<LightCluster>;
@group(0) @binding(2) var<storage, read_write> nodes: array<u32>;
@group(0) @binding(3) var<storage, read> planes: array<u32>;
// As in top_cells.wgsl.
@group(0) @binding(4) var<storage, read_write> units: array<u32>;

// The nodes of the block, a node before those below it.
var<workgroup> block_nodes: array<u32, TOP_HELD>;
// For each of them the place of its first child of the block in this list, and from bit 8 on the bits of these
// children.
var<workgroup> block_below: array<u32, TOP_HELD>;
// Where the nodes of each depth begin.
var<workgroup> block_depths: array<u32, TOP_HELD + 1u>;
var<workgroup> block_next: atomic<u32>;
var<workgroup> block_end: u32;

// Lists the nodes of the block. Returns how deep it is. Call from uniform control flow.
fn block_list(lane: u32, root: u32) -> u32 {
    if lane == 0u {
        block_nodes[0] = root;
        block_depths[0] = 0u;
        block_depths[1] = 1u;
        atomicStore(&block_next, 1u);
    }
    workgroupBarrier();
    var begin = 0u;
    var end = 1u;
    var depth = 1u;
    while begin < end {
        let place = begin + lane;
        if place < end {
            let record = top_planes(block_nodes[place]);
            let same = planes[record] & 0xffu;
            var next = atomicAdd(&block_next, countOneBits(same));
            block_below[place] = next | (same << 8u);
            for (var slot = 0u; slot < LIGHT_WIDTH; slot++) {
                if ((same >> slot) & 1u) != 0u {
                    block_nodes[next] = planes[record + TOP_PLANE_CHILDREN + slot];
                    next++;
                }
            }
        }
        workgroupBarrier();
        if lane == 0u {
            block_end = atomicLoad(&block_next);
        }
        begin = end;
        end = workgroupUniformLoad(&block_end);
        if begin < end {
            depth++;
            if lane == 0u {
                block_depths[depth] = end;
            }
        }
    }
    return depth;
}

// A child of the node at a place of the list.
fn block_child(place: u32, slot: u32) -> NodeChild {
    let child = planes[top_planes(block_nodes[place]) + TOP_PLANE_CHILDREN + slot];
    if child == LIGHT_EMPTY_SLOT {
        return NODE_NO_CHILD;
    }
    let same = block_below[place] >> 8u;
    if ((same >> slot) & 1u) == 0u {
        return NodeChild(units[child], NODE_STORED);
    }
    let held = (block_below[place] & 0xffu) + countOneBits(same & ((1u << slot) - 1u));
    return NodeChild(select(LIGHT_EMPTY_SLOT, child, pack_clusters[held].flux > 0.0), held);
}

@compute @workgroup_size(TOP_NODE_LANES)
fn top_blocks(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group.x + group.y * groups.x;
    if block >= top_pass.block_count {
        return;
    }
    let root = planes[top_pass.blocks + block];
    for (var depth = block_list(lane, root); depth > 0u; depth--) {
        let begin = workgroupUniformLoad(&block_depths[depth - 1u]);
        let end = workgroupUniformLoad(&block_depths[depth]);
        for (var some = begin; some < end; some += TOP_NODE_LANES / LIGHT_WIDTH) {
            let place = some + lane / LIGHT_WIDTH;
            let is_used = place < end;
            var child = NODE_NO_CHILD;
            var node = 0u;
            var parent = LIGHT_NO_PARENT;
            if is_used {
                node = block_nodes[place];
                parent = planes[top_planes(node) + 1u];
                child = block_child(place, lane % LIGHT_WIDTH);
            }
            node_pack(lane, node, parent, is_used, child, place);
        }
    }
    if lane == 0u {
        units[root] = select(LIGHT_EMPTY_SLOT, root, pack_clusters[0].flux > 0.0);
    }
}

// Top level, the second stage of a pass: packs the nodes whose child bits the first stage has written,
// the deepest of each piece first. Twin of `PieceTree::add_node`. One workgroup for each piece, and
// eight invocations for each node.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> clusters: array<LightCluster>;
@group(0) @binding(3) var<storage, read_write> nodes: array<u32>;
@group(0) @binding(6) var<storage, read_write> units: array<u32>;

// The first node of the piece. The deepest nodes that are not packed yet are those from node_begin up
// to, but not including, node_end.
var<workgroup> node_first: u32;
var<workgroup> node_begin: u32;
var<workgroup> node_end: u32;

@compute @workgroup_size(TOP_NODE_LANES)
fn top_node(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let piece = group.x + group.y * groups.x;
    if piece >= max(top_pass.pieces, 1u) {
        return;
    }
    if lane == 0u {
        let header = top_pass.units_after + 1u + 3u * piece;
        node_first = units[header + 1u];
        node_end = node_first + units[header + 2u];
    }
    let first = workgroupUniformLoad(&node_first);
    var end = workgroupUniformLoad(&node_end);
    while end > first {
        if lane == 0u {
            node_begin = nodes[node_tail_word(node_layout(), end - 1u) + 1u];
        }
        let begin = workgroupUniformLoad(&node_begin);
        for (var some = begin; some < end; some += TOP_NODE_LANES / LIGHT_WIDTH) {
            let node = some + lane / LIGHT_WIDTH;
            node_pack(lane, node, node < end, first);
        }
        end = begin;
    }
}

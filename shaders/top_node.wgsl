// Top level, the second stage of a round: packs the nodes whose targets the first stage has
// written. Twin of `TopLevel::add`. One invocation for each node.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> clusters: array<LightCluster>;
@group(0) @binding(3) var<storage, read_write> nodes: array<u32>;
@group(0) @binding(6) var<storage, read_write> units: array<u32>;

@compute @workgroup_size(TOP_LANES)
fn top_node(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = top_index(id, groups);
    let piece = index / TOP_MAX_GROUPS;
    if piece >= top_pass.pieces || index % TOP_MAX_GROUPS >= units[top_pass.units_after + piece] {
        return;
    }
    let node = top_pass.first_node + index;
    // A group of one unit has no node.
    if units[top_pass.units_after + top_pass.pieces + index] == top_pass.capacity + node {
        node_pack(node);
    }
}

// Top level, stage 3, after the sort: instances become the children of the lowest nodes, in the curve's order, and
// learn where they are. One invocation a child.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> instances: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> leaves: array<LightCluster>;
@group(0) @binding(6) var<storage, read_write> slots: array<u32>;
@group(0) @binding(7) var<storage, read_write> nodes: array<u32>;
// Of every node's children, at `node * LIGHT_WIDTH + child`.
@group(0) @binding(8) var<storage, read_write> clusters: array<LightCluster>;

@compute @workgroup_size(TOP_LANES)
fn top_place(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let position = top_index(id, groups);
    if position >= top_pass.count * LIGHT_WIDTH {
        return;
    }
    let place = top_pass.first * LIGHT_WIDTH + position;
    var cluster = CLUSTER_EMPTY;
    var bits = LIGHT_EMPTY_SLOT;
    if position < top_pass.slots {
        let slot = slots[position];
        cluster = leaves[slot];
        instances[slot * top_pass.instance_stride + LIGHT_INSTANCE_PLACE] = vec4(place, 0u, 0u, 0u);
        if cluster.flux > 0.0 {
            bits = LIGHT_LEAF | slot;
        }
    }
    clusters[place] = cluster;
    node_store_target(NodeLayout(top_pass.node_stride, top_pass.node_cones, top_pass.node_range), place, bits);
}

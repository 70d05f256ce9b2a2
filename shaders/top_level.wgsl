// Top level, stage 4, one dispatch a level, the lowest first: each node is merged into a child of the level above.
// One invocation a child there; those past the last node empty theirs. Twin of `TopLevel::build`.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(7) var<storage, read_write> nodes: array<LightNode>;

@compute @workgroup_size(TOP_LANES)
fn top_level(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = top_index(id, groups);
    if index >= top_pass.count_above * LIGHT_WIDTH {
        return;
    }
    let above = top_pass.first_above + index / LIGHT_WIDTH;
    let child = index % LIGHT_WIDTH;
    if index >= top_pass.count {
        nodes[above].children[child] = CHILD_EMPTY;
        return;
    }
    let node = top_pass.first + index;
    var all = cluster_empty(vec3(0.0));
    for (var slot = 0u; slot < LIGHT_WIDTH; slot++) {
        all = cluster_merge(all, child_cluster(nodes[node].children[slot]));
    }
    nodes[above].children[child] = child_pack(all, node);
    nodes[node].parent = above * LIGHT_WIDTH + child;
    nodes[node].count = LIGHT_WIDTH;
}

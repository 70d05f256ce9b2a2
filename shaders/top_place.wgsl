// Top level, stage 3, after the sort: instances become the children of the lowest nodes, in the curve's order, and
// learn where they are. One invocation a child.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> instances: array<LightInstance>;
@group(0) @binding(3) var<storage, read_write> leaves: array<LightChild>;
@group(0) @binding(6) var<storage, read_write> slots: array<u32>;
@group(0) @binding(7) var<storage, read_write> nodes: array<LightNode>;

@compute @workgroup_size(TOP_LANES)
fn top_place(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let position = top_index(id, groups);
    if position >= top_pass.count * LIGHT_WIDTH {
        return;
    }
    let node = top_pass.first + position / LIGHT_WIDTH;
    let child = position % LIGHT_WIDTH;
    if position < top_pass.slots {
        let slot = slots[position];
        nodes[node].children[child] = leaves[slot];
        instances[slot].top_place = node * LIGHT_WIDTH + child;
    } else {
        nodes[node].children[child] = CHILD_EMPTY;
    }
    if position == 0u {
        nodes[0].parent = LIGHT_NO_PARENT;
        nodes[0].count = LIGHT_WIDTH;
    }
}

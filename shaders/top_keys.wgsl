// Top level, stage 2: where each shining instance lies on a curve through space. Twin of `key` and `key_axes` in
// src/top.rs. Halves and sums only, so both get the same bits. One invocation a slot.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(3) var<storage, read_write> leaves: array<LightChild>;
@group(0) @binding(4) var<storage, read_write> bounds: array<u32, 6>;
@group(0) @binding(5) var<storage, read_write> keys: array<u32>;
@group(0) @binding(6) var<storage, read_write> slots: array<u32>;

fn curve_key(position: vec3<f32>, least: vec3<f32>, greatest: vec3<f32>) -> u32 {
    var low = least;
    var extent = greatest - least;
    var key = 0u;
    for (var bit = 0u; bit < TOP_KEY_BITS; bit++) {
        // The longest axis is halved, x before y before z.
        var axis = 2u;
        if extent.x >= extent.y && extent.x >= extent.z {
            axis = 0u;
        } else if extent.y >= extent.z {
            axis = 1u;
        }
        let half = 0.5 * extent[axis];
        let middle = low[axis] + half;
        let above = position[axis] >= middle;
        extent[axis] = half;
        if above {
            low[axis] = middle;
        }
        key = (key << 1u) | u32(above);
    }
    return key;
}

@compute @workgroup_size(TOP_LANES)
fn top_keys(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let slot = top_index(id, groups);
    if slot >= top_pass.slots {
        return;
    }
    var key = TOP_NO_KEY;
    if leaves[slot].flux > 0.0 {
        let greatest = vec3(top_unordered(bounds[0]), top_unordered(bounds[1]), top_unordered(bounds[2]));
        let least = vec3(top_unordered(~bounds[3]), top_unordered(~bounds[4]), top_unordered(~bounds[5]));
        key = curve_key(leaves[slot].mean, least, greatest);
    }
    keys[slot] = key;
    slots[slot] = slot;
}

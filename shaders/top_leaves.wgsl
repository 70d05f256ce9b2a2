// Top level, stage 1: the cluster of each part of an instance. Twin of `LightWorld::parts`. One
// invocation for each part.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> clusters: array<LightCluster>;
@group(0) @binding(2) var<storage, read_write> nodes: array<u32>;
// For each part the slot of its instance, or LIGHT_NO_INSTANCE, and its index among the parts of
// that instance.
@group(0) @binding(3) var<storage, read> parts: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> instances: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read> trees: array<LightTree>;

// Reads an instance as light_instance in records.wgsl does.
fn instance_of(slot: u32) -> LightInstance {
    let at = slot * LIGHT_INSTANCE_QUADS;
    var instance: LightInstance;
    instance.to_world = light_rows(instances[at], instances[at + 1u], instances[at + 2u]);
    let sector = bitcast<vec3<i32>>(instances[at + LIGHT_INSTANCE_SECTOR].xyz);
    instance.to_world = light_from_home(instance.to_world, sector, top_pass.home);
    instance.flags = instances[at + LIGHT_INSTANCE_TREE].x;
    instance.tree = instances[at + LIGHT_INSTANCE_TREE].y;
    instance.cos_turn = bitcast<f32>(instances[at + LIGHT_INSTANCE_PART].y);
    instance.sin_turn = bitcast<f32>(instances[at + LIGHT_INSTANCE_PART].z);
    let local = at + LIGHT_INSTANCE_LOCAL;
    instance.to_local = light_rows(instances[local], instances[local + 1u], instances[local + 2u]);
    instance.factor = bitcast<vec3<f32>>(instances[at + LIGHT_INSTANCE_FACTOR].xyz);
    instance.mask = instances[at + LIGHT_INSTANCE_FACTOR].w;
    return instance;
}

// The cluster of a part; empty if it is not in use or dark. Stores where a walk goes on below it.
fn leaf_of(index: u32) -> LightCluster {
    let part = parts[index];
    if part.x == LIGHT_NO_INSTANCE {
        return CLUSTER_EMPTY;
    }
    let instance = instance_of(part.x);
    if (instance.flags & LIGHT_LIVE) == 0u {
        return CLUSTER_EMPTY;
    }
    let tree = trees[instance.tree + part.y];
    nodes[top_part(index)] = part.x;
    nodes[top_part(index) + 1u] = tree.child_bits;
    // A dark part has no leaf.
    nodes[top_part(index) + 2u] = LIGHT_NO_PARENT;
    if top_pass.masks != 0u {
        nodes[top_part(index) + 3u] = instance.mask;
    }
    if tree.cluster.flux <= 0.0 {
        return CLUSTER_EMPTY;
    }
    let map = linear_of(instance);
    // The luminance of white may differ from 1 by rounding.
    let brightness = select(light_brightness(instance.factor), 1.0, all(instance.factor == vec3(1.0)));
    let all_flux = linear_flux(map, tree.punctual_flux, tree.area_flux, tree.cluster.axis);
    let flux = min(all_flux, LIGHT_MAX_FLUX / max(brightness, 1.0)) * brightness;
    return cluster_transformed(tree, instance, map, max(flux, LIGHT_MIN_FLUX));
}

@compute @workgroup_size(TOP_LANES)
fn top_leaves(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let part = top_index(id, groups);
    if part < top_pass.count {
        clusters[part] = leaf_of(part);
    }
}

// Top level, stage 1: the cluster of each part of an instance, and the bounds of the means of these
// clusters. Twin of `LightWorld::parts`. One invocation for each part.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> clusters: array<LightCluster>;
// See top_space.wgsl. This stage finds the extremes, the numbers and the lists. The extremes and
// the numbers are cleared before it.
@group(0) @binding(2) var<storage, read_write> bounds: array<atomic<u32>, TOP_SPACE_WORDS>;
@group(0) @binding(3) var<storage, read_write> nodes: array<u32>;
// For each part the slot of its instance, or LIGHT_NO_INSTANCE, and its index among the parts of
// that instance.
@group(0) @binding(4) var<storage, read> parts: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read> instances: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read> trees: array<LightTree>;

// The bounds for this workgroup. Maxima and sums do not depend on the order of the invocations.
var<workgroup> group_bounds: array<atomic<u32>, 8>;

// Reads an instance as light_instance in stored.wgsl does.
fn instance_of(slot: u32) -> LightInstance {
    let at = slot * top_pass.instance_stride;
    var instance: LightInstance;
    instance.to_world = light_rows(instances[at], instances[at + 1u], instances[at + 2u]);
    if top_pass.instance_sector < top_pass.instance_stride {
        let sector = bitcast<vec3<i32>>(instances[at + top_pass.instance_sector].xyz);
        instance.to_world = light_from_home(instance.to_world, sector, top_pass.home);
    }
    instance.flags = instances[at + LIGHT_INSTANCE_TREE].x;
    instance.tree = instances[at + LIGHT_INSTANCE_TREE].y;
    instance.cos_turn = bitcast<f32>(instances[at + LIGHT_INSTANCE_PART].y);
    instance.sin_turn = bitcast<f32>(instances[at + LIGHT_INSTANCE_PART].z);
    instance.to_local = light_rigid_to_local(instance.to_world);
    if top_pass.instance_sector > LIGHT_RIGID_STRIDE + LIGHT_FACTOR_QUADS {
        let local = at + LIGHT_RIGID_STRIDE;
        instance.to_local = light_rows(instances[local], instances[local + 1u], instances[local + 2u]);
    }
    instance.factor = vec3(1.0);
    instance.mask = 0xffffffffu;
    if light_has_factors(top_pass.instance_sector) {
        let last = instances[at + top_pass.instance_sector - LIGHT_FACTOR_QUADS];
        instance.factor = bitcast<vec3<f32>>(last.xyz);
        instance.mask = last.w;
    }
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
    let has_factors = light_has_factors(top_pass.instance_sector);
    let brightness = select(1.0, light_brightness(instance.factor), has_factors);
    let all_flux = linear_flux(map, tree.punctual_flux, tree.area_flux, tree.cluster.axis);
    let flux = min(all_flux, LIGHT_MAX_FLUX / max(brightness, 1.0)) * brightness;
    return cluster_transformed(tree, instance, map, max(flux, LIGHT_MIN_FLUX));
}

// Twin of `hash` in src/tree/space_order.rs.
fn leaf_hash(number: u32) -> u32 {
    let state = number * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// Adds a part to the list of its level, unless it is full. Twin of `sample` and `identity` in
// src/tree/space_order.rs. Full lists are not part of the sample, so the order of the parts does not matter.
fn leaf_list(index: u32) {
    let identity = leaf_hash(parts[index].x) + parts[index].y;
    let hash = leaf_hash(identity) | 0x1ffu;
    let zeros = countLeadingZeros(hash);
    let level = 4u * zeros + 3u - (((hash << zeros) >> 29u) & 3u);
    // A first look, because most parts find their list full.
    if atomicLoad(&bounds[8u + level]) <= TOP_LEVEL_SAMPLES {
        let place = atomicAdd(&bounds[8u + level], 1u);
        if place < TOP_LEVEL_SAMPLES {
            atomicStore(&bounds[TOP_LISTS_AT + level * TOP_LEVEL_SAMPLES + place], index);
        }
    }
}

@compute @workgroup_size(TOP_LANES)
fn top_leaves(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if lane < 8u {
        atomicStore(&group_bounds[lane], 0u);
    }
    workgroupBarrier();
    let part = top_index(id, groups);
    if part < top_pass.count {
        let leaf = leaf_of(part);
        clusters[part] = leaf;
        if leaf.flux > 0.0 {
            leaf_list(part);
            atomicAdd(&group_bounds[6], 1u);
            for (var axis = 0u; axis < 3u; axis++) {
                let place = top_ordered(leaf.mean[axis]);
                atomicMax(&group_bounds[axis], place);
                atomicMax(&group_bounds[axis + 3u], ~place);
            }
        }
    }
    workgroupBarrier();
    if lane < 6u {
        atomicMax(&bounds[lane], atomicLoad(&group_bounds[lane]));
    }
    if lane == 6u {
        atomicAdd(&bounds[6], atomicLoad(&group_bounds[6]));
    }
}

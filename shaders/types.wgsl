// The records that the host uploads and the stages share. src/gpu/layout.rs has their Rust twins, and its test
// `records_have_the_same_layout_in_rust_and_wgsl` compares every offset and stride. Binds nothing.

// Eight children, packed, and the way up: `Node` in src/tree/node.rs, which explains what is in it, in the same order.
// Words of four bytes or of two halves, the lowest bits first. In buffers the last two lie where LightParams says.
struct LightNode {
    // Least corner of all boxes, as bits of floats; steps.
    head: vec4<u32>,
    targets: array<vec4<u32>, 2>,
    flux: vec4<u32>,
    // Least corners, greatest corners, means: children 0 to 3 and 4 to 7 along x, then along y, then along z.
    // Deviation.
    boxes: array<vec4<u32>, 5>,
    // Parent, padding, shortness.
    tail: vec4<u32>,
    // #if CONES
    // Axis, along x, y and z as above; cap.
    cones: array<vec4<u32>, 2>,
    // #endif
    // #if RANGES
    range: vec4<u32>,
    // #endif
}

// A cluster at full precision: `Cluster` in src/cluster.rs. All zero but for the mean if it is dark.
struct LightCluster {
    mean: vec3<f32>,
    flux: f32,
    box_min: vec3<f32>,
    variance: f32,
    box_max: vec3<f32>,
    range: f32,
    axis: vec3<f32>,
    cos_half_angle: f32,
}

// One light in its tree's space; which fields mean what depends on the kind, see src/gpu/layout.rs. Buffers of nothing
// but points end before `b`.
struct LightRecord {
    a: vec3<f32>,
    kind: u32,
    emission: vec3<f32>,
    // The light's leaf in its tree: node * LIGHT_WIDTH + slot.
    place: u32,
    // #if CONES | AREAS | DIRECTIONAL
    b: vec3<f32>,
    // #endif
    // #if RANGES
    range: f32,
    // #endif
    // #if CONES | AREAS
    c: vec3<f32>,
    // #endif
}

// One instance slot. Rows of its linear maps; fourth components: translation, then determinant, range scale, mean
// squared scale. Buffers of instances that are only turned and moved end before `to_local`.
struct LightInstance {
    to_world: array<vec4<f32>, 3>,
    flags: u32,
    tree: u32,
    node_base: u32,
    light_base: u32,
    // Written by the top-level build: the place of the instance's leaf.
    top_place: u32,
    padding_a: u32,
    padding_b: u32,
    padding_c: u32,
    // #if NON_RIGID
    to_local: array<vec4<f32>, 3>,
    // #endif
}

// What the top level needs of a tree.
struct LightTree {
    root: LightCluster,
    punctual_flux: f32,
    area_flux: f32,
    padding: vec2<f32>,
}

struct LightParams {
    // Instance slots, live or not.
    slots: u32,
    // Directional lights are the records from here on.
    directional_base: u32,
    directional_count: u32,
    // Clusters that are opened at most.
    splits: u32,
    // In 16 bytes: from one node to the next, and where its cones and its ranges are; 0 if none has any.
    node_stride: u32,
    node_cones: u32,
    node_range: u32,
    // From one light to the next, and from one instance to the next, in 16 bytes.
    light_stride: u32,
    instance_stride: u32,
    padding_a: u32,
    padding_b: u32,
    padding_c: u32,
}

// The records that the host uploads and the stages share. src/gpu/layout.rs has their Rust twins, and its test
// `records_have_the_same_layout_in_rust_and_wgsl` compares every offset and stride. Binds nothing.

// A cluster and where it leads: `Child` in src/tree/node.rs.
struct LightChild {
    mean: vec3<f32>,
    flux: f32,
    box_min: vec3<f32>,
    variance: f32,
    box_max: vec3<f32>,
    range: f32,
    lobe_axis: u32,
    cone_axis: u32,
    angles: u32,
    target_bits: u32,
}

// Eight children and the way up: `Node` in src/tree/node.rs.
struct LightNode {
    children: array<LightChild, LIGHT_WIDTH>,
    parent: u32,
    count: u32,
    padding: vec2<u32>,
}

// One light in its tree's space; which fields mean what depends on the kind, see src/gpu/layout.rs.
struct LightRecord {
    a: vec3<f32>,
    kind: u32,
    b: vec3<f32>,
    range: f32,
    c: vec3<f32>,
    // The light's leaf in its tree: node * LIGHT_WIDTH + slot.
    place: u32,
    emission: vec3<f32>,
    padding: u32,
}

// One instance slot. Rows of its linear maps; fourth components: translation, then determinant, range scale, mean
// squared scale.
struct LightInstance {
    to_world: array<vec4<f32>, 3>,
    to_local: array<vec4<f32>, 3>,
    flags: u32,
    tree: u32,
    node_base: u32,
    light_base: u32,
    // Written by the top-level build: the place of the instance's leaf.
    top_place: u32,
    padding_a: u32,
    padding_b: u32,
    padding_c: u32,
}

// What the top level needs of a tree.
struct LightTree {
    root: LightChild,
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
    padding: u32,
}

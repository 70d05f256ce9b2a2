// The records that the host uploads and the stages share. The Rust twins are in src/plan/layout.rs.
// The test `records_have_the_same_layout_in_rust_and_wgsl` there compares every offset and size.
// Binds nothing.

// A node: eight children and the place of the node itself. Twin of `NodeRecord` in
// src/plan/node_record.rs, which explains the fields.
struct LightNode {
    // The minimum corner of all boxes, as the bits of floats; the steps of the grid.
    head: vec4<u32>,
    // See `LightPackedChild`.
    children: array<vec4<u32>, 8>,
    // The parent, and the ratios of flux by surfaces. Of the root of a tree also the index of its first light, and
    // how many lights it has. Of a node of the top level also its name: see node_pack.
    tail: vec4<u32>,
    // Two children each.
    lobes: array<vec4<u32>, 4>,
}

// A cluster at full precision. Twin of `ClusterRecord`. Of a cluster without flux all fields but
// the mean are 0.
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

// One light in the space of its tree. src/plan/layout.rs explains the fields for each kind of light.
struct LightRecord {
    a: vec3<f32>,
    kind: u32,
    emission: vec3<f32>,
    // The place of the light's leaf in its tree: node * LIGHT_WIDTH + slot.
    place: u32,
    // #if CONES | AREAS | DIRECTIONAL | PROFILES
    b: vec3<f32>,
    // #endif
    // #if RANGES
    range: f32,
    // #endif
    // #if CONES | AREAS | PROFILES
    c: vec3<f32>,
    // #endif
    // #if PROFILES
    // Where the table of its profile ends, in quads before the map of the sky.
    profile: u32,
    // #endif
}

// One instance slot. `to_local` is stored if some instance is not rigid, a factor and a mask if
// some instance has either, and the sector in worlds with sectors.
struct LightInstance {
    // The rows of the matrix; the fourth column is the translation. It is stored relative to the
    // centre of the sector, and read relative to the origin.
    to_world: array<vec4<f32>, 3>,
    flags: u32,
    // The first record, node and light of the instance's tree in their buffers.
    tree: u32,
    node_base: u32,
    light_base: u32,
    // The first of the instance's parts: its tree, or one for each opening of it.
    first_part: u32,
    // Cosine and sine of the angle by which the placement may turn one direction against another.
    cos_turn: f32,
    sin_turn: f32,
    // The engine's own 32 bits.
    user_data: u32,
    // #if NON_RIGID
    // The rows of the inverse; the fourth column is the determinant, the greatest inverse scale
    // and the mean squared scale of `to_world`.
    to_local: array<vec4<f32>, 3>,
    // #endif
    // #if FACTORS
    // What the emission of the lights is multiplied by.
    factor: vec3<f32>,
    // #endif
    // #if MASKS
    // A shading point sees the lights if its mask and this one have a bit in common.
    mask: u32,
    // #endif
    // The sector that the instance lies in.
    sector: vec3<i32>,
}

// What the top-level build reads of one part of a tree: the whole tree, or one opening of it.
// Twin of `TreeRecord`.
struct LightTree {
    cluster: LightCluster,
    punctual_flux: f32,
    area_flux: f32,
    // As in LightPart.
    child_bits: u32,
    // The place of an opening in the tree.
    place: u32,
}

// A part of an instance, which is a leaf of the top level. The parts come after the nodes of the
// top level; its build writes them.
struct LightPart {
    // The slot of the instance.
    slot: u32,
    // Where a walk goes on in the instance's tree: a node, or LIGHT_LEAF with a light.
    child_bits: u32,
    // The place of the part's leaf: node * LIGHT_WIDTH + slot. LIGHT_NO_PARENT for a dark part.
    place: u32,
    // The mask of the instance; not set unless masks are stored.
    mask: u32,
}

// The parameters of sampling. Twin of `ParamsRecord`.
struct LightParams {
    // The number of instance slots, live or not.
    slots: u32,
    // The first record of the directional lights, and how many there are.
    directional_base: u32,
    directional_count: u32,
    // The slot of the sky's instance; LIGHT_NO_INSTANCE if there is none to be seen.
    sky: u32,
    // 1 if large and near surfaces are sampled by solid angle.
    solid_angles: u32,
    // The offset of the parts in the buffer of the top level. Offsets are in units of 16 bytes.
    parts: u32,
    // The offset of the sky's map in the same buffer.
    sky_map: u32,
    // The offset of the masks in the same buffer; 0 if they are not stored. See `NodeMasks` in
    // src/top/masks.rs.
    masks: u32,
    // The sector whose centre the origin is; 0 in worlds without sectors.
    home: vec3<i32>,
}

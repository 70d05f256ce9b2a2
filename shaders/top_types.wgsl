// What the stages of the top-level build share. Twin of `TopPass` in src/gpu/top.rs, which compares them. Binds nothing.

// One level of nodes.
struct TopPass {
    // Instance slots.
    slots: u32,
    // The level's first node, and how many it has.
    first: u32,
    count: u32,
    // The same of the level above; the root has none.
    first_above: u32,
    count_above: u32,
    // How records are stored: see LightParams.
    node_stride: u32,
    node_cones: u32,
    node_range: u32,
    light_stride: u32,
    instance_stride: u32,
    padding_a: u32,
    padding_b: u32,
}

// The number of an invocation in a dispatch of one or two dimensions.
fn top_index(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.y * groups.x * TOP_LANES + id.x;
}

// A number's bits in an order that unsigned integers have too, so that atomics find extremes. 0 comes before all.
fn top_ordered(x: f32) -> u32 {
    let bits = bitcast<u32>(x);
    return select(bits | 0x80000000u, ~bits, (bits & 0x80000000u) != 0u);
}

fn top_unordered(ordered: u32) -> f32 {
    return bitcast<f32>(select(~ordered, ordered & 0x7fffffffu, (ordered & 0x80000000u) != 0u));
}

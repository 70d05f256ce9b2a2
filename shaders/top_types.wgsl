// What the stages of the top-level build share. Twin of `TopPass` in src/gpu/top.rs, which compares them. Binds
// nothing.

// A round of the build. Units are instances and nodes that hang nowhere yet: a number below `capacity` is a slot, one
// above it a node.
struct TopPass {
    // Instance slots.
    slots: u32,
    // Slots that there is room for: clusters of nodes lie behind those of so many instances.
    capacity: u32,
    // Where the last round's units lie, or TOP_SORTED if this is the first; and how many pieces left them.
    units_before: u32,
    pieces_before: u32,
    // Where this round's units go: the numbers of units that each piece leaves, then TOP_LEFT places for each.
    units_after: u32,
    pieces: u32,
    // This round's first node.
    first_node: u32,
    // How records are stored: see LightParams.
    node_stride: u32,
    node_cones: u32,
    node_range: u32,
    light_stride: u32,
    instance_stride: u32,
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

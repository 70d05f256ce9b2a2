// What the stages of the top-level build share. Binds nothing.

// One pass of the build. A unit is a part of an instance or a node that has no parent yet. The
// number of a unit is that of the part if it is below `capacity`, and otherwise `capacity` plus the
// node's index. Twin of `TopPass` in src/plan/top/passes.rs; the test
// `the_stages_are_valid_and_have_the_sizes_that_the_host_expects` compares them.
struct TopPass {
    // The number of parts, in use or not.
    count: u32,
    // The number of parts that there is room for. The clusters of the nodes come after the clusters
    // of that many parts.
    capacity: u32,
    // Where the parts begin in the buffer of the nodes, in units of 16 bytes.
    parts: u32,
    // The place in `units` of what the last pass has left, and how many pieces it had.
    // `units_before` is TOP_FIRST_PASS in the first pass, whose units are the parts in the order
    // of the sort.
    units_before: u32,
    pieces_before: u32,
    // The place in `units` of what this pass leaves. One word: how many entries each piece has.
    // Three words for each piece: how many units it leaves, its first node, the number of its nodes.
    // Then the entries, which are the numbers of these units.
    units_after: u32,
    // The greatest number of pieces; 0 in the last pass, whose one piece is the whole tree.
    pieces: u32,
    // The first node of this pass. The nodes of a piece begin one node after that for each
    // TOP_UNITS_PER_NODE units before the piece.
    first_node: u32,
    // The layout of records: see LightParams.
    node_stride: u32,
    node_lobes: u32,
    light_stride: u32,
    instance_stride: u32,
    instance_sector: u32,
    // Where the masks of the nodes begin in the buffer of the nodes, in units of 16 bytes; 0 if they
    // are not stored.
    masks: u32,
    // The number of keys of a block of the sort.
    sort_block: u32,
    // The sector whose centre the origin is. Only the first stage reads it.
    home: vec3<i32>,
}

// The first word of a part in the buffer of the nodes: see LightPart.
fn top_part(index: u32) -> u32 {
    return 4u * (top_pass.parts + index);
}

// The first word of a node's masks: three for the shares of the node, one unused, then one for each
// child. See `NodeMasks` in src/top/masks.rs.
fn top_masks(node: u32) -> u32 {
    return 4u * (top_pass.masks + LIGHT_MASK_QUADS * node);
}

// The index of an invocation in a dispatch of one or two dimensions.
fn top_index(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.y * groups.x * TOP_LANES + id.x;
}

// The bits of a float, changed so that unsigned integers have the same order as the floats. Atomics
// can then find extremes. 0 is below the bits of every number.
fn top_ordered(x: f32) -> u32 {
    let bits = bitcast<u32>(x);
    return select(bits | 0x80000000u, ~bits, (bits & 0x80000000u) != 0u);
}

// The float of such bits.
fn top_unordered(ordered: u32) -> f32 {
    return bitcast<f32>(select(~ordered, ordered & 0x7fffffffu, (ordered & 0x80000000u) != 0u));
}

// What the stages of the top-level build share. Binds nothing.

// The parameters of a dispatch. Twin of `TopPass` in src/plan/top/buffers.rs; the test
// `the_stages_are_valid_and_have_the_sizes_that_the_host_expects` compares them.
struct TopPass {
    // The number of parts, in use or not.
    count: u32,
    // The number of parts that there is room for. The clusters of the nodes come after the clusters
    // of that many parts.
    capacity: u32,
    // Where the parts begin in the buffer of the nodes, in units of 16 bytes.
    parts: u32,
    // The number of nodes of the partition, in use or not.
    nodes: u32,
    // The index of the first run.
    runs: u32,
    // Whether the root of the partition is divided.
    is_divided: u32,
    // The word of `planes` at which the roots of the blocks of this stage begin, and their number.
    blocks: u32,
    block_count: u32,
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

// The first word of a divided node's record in `planes`. Twin of `PlanesRecord` in
// src/plan/top/partition.rs: the bits of the children that are of its block, from bit 8 on those of the
// children that are divided; the place of its parent; where its planes are, and
// from which sectors; two codes of planes in each
// word; its children.
fn top_planes(node: u32) -> u32 {
    return TOP_PLANES_WORDS * node;
}

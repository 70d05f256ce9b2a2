// Stores nodes as sampling reads them, of the top level and of trees that are refitted. Binds nothing;
// writes the variable `nodes` of the stage. `nodes` is an array of words because several invocations
// write the child bits of one node, and a write to one component of a vector may touch the whole vector.

// Stores 16 bytes; `at` is in units of 16 bytes.
fn node_store_words(at: u32, words: vec4<u32>) {
    nodes[4u * at] = words.x;
    nodes[4u * at + 1u] = words.y;
    nodes[4u * at + 2u] = words.z;
    nodes[4u * at + 3u] = words.w;
}

// Stores a node without its children: the origin and the exponents of the steps of its grid, and the
// place of its parent.
fn node_store(index: u32, origin: vec3<f32>, bits: vec3<u32>, parent: u32) {
    let at = index * LIGHT_NODE_QUADS;
    let steps = (LIGHT_WIDTH << 24u) | bits.x | (bits.y << 8u) | (bits.z << 16u);
    node_store_words(at, vec4(bitcast<vec3<u32>>(origin), steps));
    node_store_words(at + LIGHT_NODE_TAIL, vec4(parent, 0u, 0u, 0u));
}

// Stores a child without its child bits; `place` is node * LIGHT_WIDTH + slot.
fn node_store_child(place: u32, child: PackedChild) {
    let word = node_child_word(place);
    nodes[word + 1u] = child.low;
    nodes[word + 2u] = child.high;
    nodes[word + 3u] = child.mean;
    let lobe = node_lobe_word(place);
    nodes[lobe] = child.lobe.x;
    nodes[lobe + 1u] = child.lobe.y;
}

// The word of a child's bits; `place` is node * LIGHT_WIDTH + slot.
fn node_child_word(place: u32) -> u32 {
    return 4u * ((place / LIGHT_WIDTH) * LIGHT_NODE_QUADS + LIGHT_NODE_CHILDREN + place % LIGHT_WIDTH);
}

// The first word of a child's lobe.
fn node_lobe_word(place: u32) -> u32 {
    return 4u * ((place / LIGHT_WIDTH) * LIGHT_NODE_QUADS + LIGHT_NODE_LOBES) + 2u * (place % LIGHT_WIDTH);
}

// Stores the child bits of the child at a place.
fn node_store_child_bits(place: u32, child_bits: u32) {
    nodes[node_child_word(place)] = child_bits;
}

// The first word after the children of a node.
fn node_tail_word(node: u32) -> u32 {
    return 4u * (node * LIGHT_NODE_QUADS + LIGHT_NODE_TAIL);
}

// Stores the place of a node's parent.
fn node_store_parent(node: u32, place: u32) {
    nodes[node_tail_word(node)] = place;
}

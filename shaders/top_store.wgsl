// Stores nodes of the top level as sampling reads them. Binds nothing; writes the variable `nodes`
// of the stage. `nodes` is an array of words because several invocations write the targets of one
// node, and a write to one component of a vector may touch the whole vector.

// The stride of nodes and the offset of the lobes, in units of 16 bytes; the offset is 0 if they are
// not stored.
struct NodeLayout {
    stride: u32,
    lobes: u32,
}

// Stores 16 bytes; `at` is in units of 16 bytes.
fn node_store_words(at: u32, words: vec4<u32>) {
    nodes[4u * at] = words.x;
    nodes[4u * at + 1u] = words.y;
    nodes[4u * at + 2u] = words.z;
    nodes[4u * at + 3u] = words.w;
}

// Stores a node without its targets.
fn node_store(stored: NodeLayout, index: u32, node: LightNode, parent: u32) {
    let at = index * stored.stride;
    node_store_words(at, node.head);
    for (var slot = 0u; slot < LIGHT_WIDTH; slot++) {
        let child = 4u * (at + LIGHT_NODE_CHILDREN + slot);
        nodes[child + 1u] = node.children[slot].y;
        nodes[child + 2u] = node.children[slot].z;
        nodes[child + 3u] = node.children[slot].w;
    }
    node_store_words(at + LIGHT_NODE_TAIL, vec4(parent, 0u, 0u, 0u));
    if stored.lobes != 0u {
        for (var two = 0u; two < LIGHT_WIDTH / 2u; two++) {
            node_store_words(at + stored.lobes + two, node.lobes[two]);
        }
    }
}

// The word of a child's target; `place` is node * LIGHT_WIDTH + slot.
fn node_target_word(stored: NodeLayout, place: u32) -> u32 {
    return 4u * ((place / LIGHT_WIDTH) * stored.stride + LIGHT_NODE_CHILDREN + place % LIGHT_WIDTH);
}

// Stores the target of the child at a place.
fn node_store_target(stored: NodeLayout, place: u32, target_bits: u32) {
    nodes[node_target_word(stored, place)] = target_bits;
}

fn node_layout() -> NodeLayout {
    return NodeLayout(top_pass.node_stride, top_pass.node_lobes);
}

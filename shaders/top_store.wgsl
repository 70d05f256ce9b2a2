// Stores nodes of the top level as sampling reads them. Binds nothing; writes the variable `nodes`
// of the stage. `nodes` is an array of words because several invocations write the targets of one
// node, and a write to one component of a vector may touch the whole vector.

// The stride of nodes and the offsets of the cones and ranges, in units of 16 bytes; an offset is 0
// if the part is not stored.
struct NodeLayout {
    stride: u32,
    cones: u32,
    range: u32,
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
    node_store_words(at + LIGHT_NODE_FLUX, node.flux);
    node_store_words(at + LIGHT_NODE_BOXES, node.boxes[0]);
    node_store_words(at + LIGHT_NODE_BOXES + 1u, node.boxes[1]);
    node_store_words(at + LIGHT_NODE_BOXES + 2u, node.boxes[2]);
    node_store_words(at + LIGHT_NODE_BOXES + 3u, node.boxes[3]);
    node_store_words(at + LIGHT_NODE_BOXES + 4u, node.boxes[4]);
    node_store_words(at + LIGHT_NODE_TAIL, vec4(parent, 0u, node.tail.z, node.tail.w));
    if stored.cones != 0u {
        node_store_words(at + stored.cones, node.cones[0]);
        node_store_words(at + stored.cones + 1u, node.cones[1]);
    }
    if stored.range != 0u {
        node_store_words(at + stored.range, node.range);
    }
}

// Stores the target of the child at a place, which is node * LIGHT_WIDTH + slot.
fn node_store_target(stored: NodeLayout, place: u32, target_bits: u32) {
    nodes[4u * ((place / LIGHT_WIDTH) * stored.stride + LIGHT_NODE_TARGETS) + place % LIGHT_WIDTH] = target_bits;
}

fn node_layout() -> NodeLayout {
    return NodeLayout(top_pass.node_stride, top_pass.node_cones, top_pass.node_range);
}

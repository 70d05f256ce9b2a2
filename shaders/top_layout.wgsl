// How the top level is stored while it is built. Binds nothing; uses the variables `top_pass` and `nodes`
// of the stage.

fn node_layout() -> NodeLayout {
    return NodeLayout(top_pass.node_stride, top_pass.node_lobes);
}

// Stores which node of a piece is the first of the same depth. Packing removes that again.
fn node_store_depth(stored: NodeLayout, node: u32, first: u32) {
    nodes[node_tail_word(stored, node) + 1u] = first;
}

// Packs a node of the top level. Binds nothing; uses the variables `top_pass`, `clusters` and
// `nodes` of the stage.

// The cluster of a child.
fn node_child(target_bits: u32) -> LightCluster {
    if target_bits == LIGHT_EMPTY_SLOT {
        return CLUSTER_EMPTY;
    }
    if (target_bits & LIGHT_LEAF) != 0u {
        return clusters[target_bits & ~LIGHT_LEAF];
    }
    return clusters[top_pass.capacity + target_bits];
}

// The target of the leaf that is a part. Twin of `Part::leaf`.
fn node_leaf(part: u32) -> u32 {
    let below = nodes[top_part(part) + 1u];
    if below == 0u {
        return LIGHT_LEAF | nodes[top_part(part)];
    }
    return LIGHT_LEAF | LIGHT_PART | select(0u, LIGHT_SINGLE, (below & LIGHT_LEAF) != 0u) | part;
}

// The union of the masks of all instances below a child.
fn node_mask(target_bits: u32) -> u32 {
    if target_bits == LIGHT_EMPTY_SLOT {
        return 0u;
    }
    if (target_bits & LIGHT_LEAF) != 0u {
        return nodes[top_part(target_bits & ~LIGHT_LEAF) + 3u];
    }
    var all_masks = 0u;
    for (var slot = 0u; slot < LIGHT_WIDTH; slot++) {
        all_masks |= nodes[top_masks(target_bits) + slot];
    }
    return all_masks;
}

// Packs a node from the clusters of the children that its targets name, and writes into each child
// where its parent is.
fn node_pack(node: u32) {
    let stored = node_layout();
    let at = node_target_word(stored, node * LIGHT_WIDTH);
    let eight = ClusterEight(
        cluster_four(
            node_child(nodes[at]),
            node_child(nodes[at + 4u]),
            node_child(nodes[at + 8u]),
            node_child(nodes[at + 12u]),
        ),
        cluster_four(
            node_child(nodes[at + 16u]),
            node_child(nodes[at + 20u]),
            node_child(nodes[at + 24u]),
            node_child(nodes[at + 28u]),
        ),
    );
    let merged = cluster_merged(eight);
    node_store(stored, node, node_packed(eight, merged), LIGHT_NO_PARENT);
    clusters[top_pass.capacity + node] = merged;
    for (var slot = 0u; slot < LIGHT_WIDTH; slot++) {
        let bits = nodes[at + 4u * slot];
        let place = node * LIGHT_WIDTH + slot;
        if top_pass.masks != 0u {
            nodes[top_masks(node) + slot] = node_mask(bits);
        }
        if bits == LIGHT_EMPTY_SLOT {
            continue;
        }
        if (bits & LIGHT_LEAF) != 0u {
            let part = bits & ~LIGHT_LEAF;
            nodes[top_part(part) + 2u] = place;
            nodes[at + 4u * slot] = node_leaf(part);
        } else {
            nodes[4u * (bits * stored.stride + LIGHT_NODE_TAIL)] = place;
        }
    }
}

// Top level, stage 4, one dispatch a level, the lowest first: each node is packed from its children's clusters and merged
// into a child of the level above. One invocation a child there; those past the last node empty theirs. Twin of
// `TopLevel::build`.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(7) var<storage, read_write> nodes: array<u32>;
@group(0) @binding(8) var<storage, read_write> clusters: array<LightCluster>;

@compute @workgroup_size(TOP_LANES)
fn top_level(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = top_index(id, groups);
    let stored = NodeLayout(top_pass.node_stride, top_pass.node_cones, top_pass.node_range);
    let is_root = top_pass.count_above == 0u;
    let place = top_pass.first_above * LIGHT_WIDTH + index;
    let is_node = index < top_pass.count;
    let node = top_pass.first + index;
    var merged = CLUSTER_EMPTY;
    if is_node {
        let first = node * LIGHT_WIDTH;
        let eight = ClusterEight(
            cluster_four(clusters[first], clusters[first + 1u], clusters[first + 2u], clusters[first + 3u]),
            cluster_four(clusters[first + 4u], clusters[first + 5u], clusters[first + 6u], clusters[first + 7u]),
        );
        merged = cluster_merged(eight);
        // All but the targets, which the level below has written.
        node_store(stored, node, node_packed(eight, merged), select(place, LIGHT_NO_PARENT, is_root));
    }
    if index < top_pass.count_above * LIGHT_WIDTH {
        clusters[place] = merged;
        node_store_target(stored, place, select(LIGHT_EMPTY_SLOT, node, merged.flux > 0.0));
    }
}

// Top level, stage 3: the place of each part that shines in the order in space, as its key for
// the sort, which it counts. One invocation for each part.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> clusters: array<LightCluster>;
@group(0) @binding(2) var<storage, read_write> bounds: array<u32, TOP_SPACE_WORDS>;
@group(0) @binding(3) var<storage, read_write> keys: array<u32>;
@group(0) @binding(4) var<storage, read_write> order: array<u32>;
@group(0) @binding(5) var<storage, read_write> histogram: array<atomic<u32>>;

@compute @workgroup_size(TOP_LANES)
fn top_keys(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let part = top_index(id, groups);
    if part >= top_pass.count {
        return;
    }
    var key = TOP_NO_KEY;
    if clusters[part].flux > 0.0 {
        key = space_key(clusters[part].mean);
    }
    keys[part] = key;
    order[part] = part;
    // The sort begins with the lowest digit, whose counts are the first.
    sort_count_key(0u, top_pass.count, top_pass.sort_block, part, key & (SORT_LANES - 1u));
}

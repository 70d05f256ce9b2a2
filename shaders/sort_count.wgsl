// Radix sort: counts the digits of the first pass, where no other stage has done so. One invocation for
// each key.

@group(0) @binding(0) var<uniform> pass_: SortPass;
@group(0) @binding(1) var<storage, read> keys_in: array<u32>;
@group(0) @binding(5) var<storage, read_write> histogram: array<atomic<u32>>;

@compute @workgroup_size(SORT_LANES)
fn sort_count(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = (group.x + group.y * groups.x) * SORT_LANES + lane;
    if i < pass_.count {
        sort_count_key(pass_.counts, pass_.count, pass_.block_keys, i, sort_digit(keys_in[i], pass_.shift));
    }
}

// Radix sort, stage 1 of 3: counts how often each digit occurs in each block. One workgroup for
// each block.

@group(0) @binding(0) var<uniform> pass_: SortPass;
@group(0) @binding(1) var<storage, read> keys_in: array<u32>;
// [digit][block], then the total of each digit.
@group(0) @binding(5) var<storage, read_write> histogram: array<u32>;

var<workgroup> digits: array<atomic<u32>, SORT_LANES>;

@compute @workgroup_size(SORT_LANES)
fn sort_count(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    atomicStore(&digits[lane], 0u);
    workgroupBarrier();
    let block = group.x;
    let first = block * pass_.rounds * SORT_LANES + lane;
    for (var round = 0u; round < pass_.rounds; round++) {
        let i = first + round * SORT_LANES;
        if i < pass_.count {
            atomicAdd(&digits[sort_digit(keys_in[i], pass_.shift)], 1u);
        }
    }
    workgroupBarrier();
    histogram[lane * pass_.blocks + block] = atomicLoad(&digits[lane]);
}

// Radix sort, stage 2 of 3: turns the counts of each digit into exclusive prefix sums over the
// blocks, and stores their total. One workgroup for each digit. Every workgroup of the scatter
// stage adds up the 256 totals again, which is cheaper than a dispatch.

@group(0) @binding(0) var<uniform> pass_: SortPass;
@group(0) @binding(5) var<storage, read_write> histogram: array<u32>;

@compute @workgroup_size(SORT_LANES)
fn sort_scan(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let digit = group.x;
    let row = digit * pass_.blocks;
    var before = 0u;
    for (var first = 0u; first < pass_.blocks; first += SORT_LANES) {
        let block = first + lane;
        var value = 0u;
        if block < pass_.blocks {
            value = histogram[row + block];
        }
        let sums = sort_prefix(lane, value);
        if block < pass_.blocks {
            histogram[row + block] = before + sums.x;
        }
        before += sums.y;
    }
    if lane == 0u {
        histogram[SORT_LANES * pass_.blocks + digit] = before;
    }
}

// Exclusive prefix sum over the lanes of one workgroup, after Hillis and Steele (1986): log2 steps
// that alternate between two rows. Binds nothing.

var<workgroup> sort_prefix_rows: array<array<u32, SORT_LANES>, 2>;

// x: the sum of `value` over the lanes before this one; y: the sum over all lanes. Call from
// uniform control flow.
fn sort_prefix(lane: u32, value: u32) -> vec2<u32> {
    sort_prefix_rows[0][lane] = value;
    workgroupBarrier();
    var row = 0u;
    for (var reach = 1u; reach < SORT_LANES; reach *= 2u) {
        var sum = sort_prefix_rows[row][lane];
        if lane >= reach {
            sum += sort_prefix_rows[row][lane - reach];
        }
        sort_prefix_rows[1u - row][lane] = sum;
        row = 1u - row;
        workgroupBarrier();
    }
    let sums = vec2(sort_prefix_rows[row][lane] - value, sort_prefix_rows[row][SORT_LANES - 1u]);
    // The next call may write the rows at once.
    workgroupBarrier();
    return sums;
}

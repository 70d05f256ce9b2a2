// What the stages of the radix sort share. Binds nothing. src/plan/sort.rs defines four constants:
// - SORT_LANES: the invocations in a workgroup. A digit has as many values, so lane d owns digit d.
// - SORT_DIGIT_BITS: the bits of a digit.
// - SORT_WORDS: the words of a bitmap with one bit for each lane.
// - SORT_GROUP: the blocks in a group of blocks, for which the histogram has sums.

// Twin of `SortPass` in src/plan/sort.rs. The test
// `the_stages_have_the_sizes_that_the_host_expects` there compares them.
struct SortPass {
    // The number of keys.
    count: u32,
    // The number of keys of a block, a multiple of SORT_LANES. The last block may extend past the keys.
    block_keys: u32,
    // The lowest bit of the digit of this pass.
    shift: u32,
    // Where the counts of this pass begin in the histogram.
    counts: u32,
    // Where those of the next pass begin; 0 in the last pass.
    next_counts: u32,
}

fn sort_digit(key: u32, shift: u32) -> u32 {
    return (key >> shift) & (SORT_LANES - 1u);
}

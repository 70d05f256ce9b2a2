// What the three stages of the radix sort share. Binds nothing. src/plan/sort.rs defines two
// constants: SORT_LANES is the number of invocations in a workgroup and also of the values of a
// digit, so that lane d can own digit d. SORT_WORDS is the number of words with one bit for each
// lane.

// Twin of `SortPass` in src/plan/sort.rs. The test
// `the_stages_have_the_sizes_that_the_host_expects` there compares them.
struct SortPass {
    // The number of keys.
    count: u32,
    // The number of blocks. A block is `rounds * SORT_LANES` consecutive keys; the last one may
    // extend past the keys.
    blocks: u32,
    rounds: u32,
    // The lowest bit of the digit of this pass.
    shift: u32,
}

fn sort_digit(key: u32, shift: u32) -> u32 {
    return (key >> shift) & (SORT_LANES - 1u);
}

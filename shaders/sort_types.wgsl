// What the three stages of the radix sort share. Twin of `SortPass` in src/gpu/sort.rs, whose test
// `the_shaders_agree_with_the_host_about_sizes` compares them. Two constants come from there: SORT_LANES, the
// invocations of a workgroup, which a digit has as many values as, so lane d can own digit d; and SORT_WORDS, the
// words that hold a bit for each lane.

struct SortPass {
    // Keys to sort.
    count: u32,
    // Blocks of `rounds * SORT_LANES` consecutive keys, the last one partly empty.
    blocks: u32,
    rounds: u32,
    // Lowest bit of this pass's digit.
    shift: u32,
}

fn sort_digit(key: u32, shift: u32) -> u32 {
    return (key >> shift) & (SORT_LANES - 1u);
}

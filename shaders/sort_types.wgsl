// What the three stages of the radix sort share. src/gpu/sort.rs has the Rust twins; its test
// `the_shaders_agree_with_the_host_about_sizes_and_bindings` compares them.

// Invocations in a workgroup; one digit has as many values, so lane d can own digit d.
const SORT_LANES: u32 = 256u;
// 32-bit words that hold one bit for each lane.
const SORT_WORDS: u32 = SORT_LANES / 32u;

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

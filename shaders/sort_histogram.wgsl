// The counts of the radix sort: how often each digit occurs in each block, and in each group of
// SORT_GROUP blocks, so that the sum over all blocks before one is short. Binds nothing; uses the
// variable `histogram` of the stage, which is cleared before the first pass.
//
// The counts of a pass are [block][digit], then [group of blocks][digit].

// Counts a key that is at `place` before the pass whose counts begin at `at`. A block has `block_keys`
// keys.
fn sort_count_key(at: u32, count: u32, block_keys: u32, place: u32, digit: u32) {
    let blocks = (count + block_keys - 1u) / block_keys;
    let block = place / block_keys;
    atomicAdd(&histogram[at + block * SORT_LANES + digit], 1u);
    atomicAdd(&histogram[at + (blocks + block / SORT_GROUP) * SORT_LANES + digit], 1u);
}

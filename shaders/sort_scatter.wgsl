// Radix sort, one pass: writes each key to its place, and counts its next digit there for the next pass.
// The place of a key is the number of keys with lower digits, plus the number of keys with its digit
// in earlier blocks, in earlier rounds of its block and in lower lanes of its round. The last number
// comes from a bitmap of the lanes. The order in which atomics set its bits does not matter, so the
// place depends on nothing but the keys. One workgroup for each block.

@group(0) @binding(0) var<uniform> pass_: SortPass;
@group(0) @binding(1) var<storage, read> keys_in: array<u32>;
@group(0) @binding(2) var<storage, read> values_in: array<u32>;
@group(0) @binding(3) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(4) var<storage, read_write> values_out: array<u32>;
@group(0) @binding(5) var<storage, read_write> histogram: array<atomic<u32>>;

// The place of the next key of each digit.
var<workgroup> next: array<u32, SORT_LANES>;
// [word][digit]: the lanes whose key has that digit. Words are the outer index, so that
// neighbouring digits are in different banks.
var<workgroup> lanes_of: array<array<atomic<u32>, SORT_LANES>, SORT_WORDS>;

// The number of keys with a digit in the blocks before one (x), and in all blocks (y).
fn sort_keys_before(block: u32, digit: u32) -> vec2<u32> {
    let blocks = (pass_.count + pass_.block_keys - 1u) / pass_.block_keys;
    let groups = (blocks + SORT_GROUP - 1u) / SORT_GROUP;
    var before = 0u;
    var all_keys = 0u;
    for (var group = 0u; group < groups; group++) {
        let keys = atomicLoad(&histogram[pass_.counts + (blocks + group) * SORT_LANES + digit]);
        all_keys += keys;
        before += select(0u, keys, group < block / SORT_GROUP);
    }
    for (var other = block / SORT_GROUP * SORT_GROUP; other < block; other++) {
        before += atomicLoad(&histogram[pass_.counts + other * SORT_LANES + digit]);
    }
    return vec2(before, all_keys);
}

@compute @workgroup_size(SORT_LANES)
fn sort_scatter(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let block = group.x;
    for (var word = 0u; word < SORT_WORDS; word++) {
        atomicStore(&lanes_of[word][lane], 0u);
    }
    // Its barriers come before the first bit is set.
    let before = sort_keys_before(block, lane);
    next[lane] = before.x + sort_prefix(lane, before.y).x;
    let first = block * pass_.block_keys + lane;
    let own_word = lane / 32u;
    let own_bit = 1u << (lane % 32u);
    for (var round = 0u; round < pass_.block_keys / SORT_LANES; round++) {
        let i = first + round * SORT_LANES;
        var key = 0u;
        var digit = 0u;
        if i < pass_.count {
            key = keys_in[i];
            digit = sort_digit(key, pass_.shift);
            atomicOr(&lanes_of[own_word][digit], own_bit);
        }
        workgroupBarrier();
        if i < pass_.count {
            var place = next[digit];
            for (var word = 0u; word < own_word; word++) {
                place += countOneBits(atomicLoad(&lanes_of[word][digit]));
            }
            place += countOneBits(atomicLoad(&lanes_of[own_word][digit]) & (own_bit - 1u));
            keys_out[place] = key;
            values_out[place] = values_in[i];
            if pass_.next_counts != 0u {
                let digit_after = sort_digit(key, pass_.shift + SORT_DIGIT_BITS);
                sort_count_key(pass_.next_counts, pass_.count, pass_.block_keys, place, digit_after);
            }
        }
        workgroupBarrier();
        // This lane owns digit `lane`: it counts the keys and clears the bits for the next round.
        var count = 0u;
        for (var word = 0u; word < SORT_WORDS; word++) {
            count += countOneBits(atomicExchange(&lanes_of[word][lane], 0u));
        }
        next[lane] += count;
        workgroupBarrier();
    }
}

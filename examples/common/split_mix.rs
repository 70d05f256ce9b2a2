//! SplitMix64, the random numbers of tests and benches.
//!
//! Source: Steele, Lea and Flood, Fast Splittable Pseudorandom Number Generators (2014).

/// The step of the state: 2^64 over the golden ratio, made odd.
pub const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// Advances a state and returns its next 64 random bits.
pub fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_add(STEP);
    mix(*state)
}

/// The random bits of a state.
pub fn mix(state: u64) -> u64 {
    let x = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

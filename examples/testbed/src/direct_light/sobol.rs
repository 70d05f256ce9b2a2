//! Sobol' numbers with Owen's scrambling, for comparisons that must not depend on the sequence of
//! this repository's own pictures.
//!
//! Sources: Joe and Kuo, Constructing Sobol Sequences with Better Two-Dimensional Projections
//! (2008), for the direction numbers; Burley, Practical Hash-based Owen Scrambling (JCGT 2020), for
//! the scrambling.

use crate::common::hash::pcg4d;
use crate::render::sequence::directions;

/// The numbers of a sample.
const DIMENSIONS: usize = 5;
/// Samples beyond 2^`BITS` repeat.
const BITS: usize = 16;
const DIRECTIONS: [[u32; DIMENSIONS]; 32] = directions();

/// Five numbers in [0, 1), which depend on the arguments only. Those of the samples of a pixel are
/// a scrambled Sobol' sequence.
pub fn sobol(pixel: u32, sample: u32, seed: u32) -> [f32; DIMENSIONS] {
    let [a, b, c, d] = pcg4d([pixel, seed, 0x50b0_1001, 0x9e37_79b9]);
    let seeds = [a, b, c, d, a ^ c.rotate_left(16)];
    std::array::from_fn(|dimension| {
        let (mut value, mut rest) = (0, sample & ((1 << BITS) - 1));
        while rest != 0 {
            value ^= DIRECTIONS[rest.trailing_zeros() as usize][dimension];
            rest &= rest - 1;
        }
        (scrambled(value, seeds[dimension]) >> 8) as f32 * (1.0 / 16_777_216.0)
    })
}

/// Flips each bit by a hash of the bits above it.
fn scrambled(value: u32, seed: u32) -> u32 {
    let mut x = value.reverse_bits().wrapping_add(seed);
    for factor in [0x6c50_b47c, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6] {
        x ^= x.wrapping_mul(factor);
    }
    x.reverse_bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_numbers_fall_into_sixteen_intervals_and_the_first_two_into_all_elementary_ones() {
        for (pixel, start) in [(0, 0), (7, 16), (123_456, 1_024)] {
            let points: Vec<_> = (start..start + 16).map(|sample| sobol(pixel, sample, 3)).collect();
            let cells = |cell: &dyn Fn(&[f32; DIMENSIONS]) -> usize| {
                let mut filled = [false; 16];
                points.iter().for_each(|point| filled[cell(point)] = true);
                filled.iter().all(|filled| *filled)
            };
            for dimension in 0..DIMENSIONS {
                assert!(cells(&|point| (point[dimension] * 16.0) as usize), "dimension {dimension}");
            }
            for columns in [2.0, 4.0, 8.0] {
                let rows = 16.0 / columns;
                let cell = |point: &[f32; DIMENSIONS]| {
                    (point[0] * columns) as usize * rows as usize + (point[1] * rows) as usize
                };
                assert!(cells(&cell), "{columns} columns");
            }
        }
        assert_ne!(sobol(1, 0, 3), sobol(2, 0, 3));
        assert_ne!(sobol(1, 0, 3), sobol(1, 0, 4));
    }
}

//! The random numbers of a picture: Owen-scrambled Sobol' points, whose errors differ between
//! neighbouring pixels like blue noise. `sequence.wgsl` is the twin.
//!
//! The pixels of a tile share one sequence. Each pixel takes a block of it, in the order of a
//! Morton curve that is scrambled like the points, so that the samples of neighbouring pixels are
//! evenly distributed together. A filter or an eye that averages them then sees less noise.
//!
//! Sources: Sobol' points with the direction numbers of Joe and Kuo (2008); scrambling by a hash,
//! and the shuffled second set of dimensions, as in Burley, Practical Hash-based Owen Scrambling
//! (JCGT 2020), with Vegdahl's hash (2021); blocks in Morton order as in Ahmed and Wonka,
//! Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of
//! Pixels (2020). Differs: one scramble of the whole index permutes pixels and samples at once.

use crate::common::hash::pcg4d;

/// The most bits of a pixel's coordinate within its tile.
const MAX_TILE_BITS: u32 = 10;
/// Bits of a sample's index.
const INDEX_BITS: u32 = 32;

/// Direction numbers of four dimensions, by bit of the index from the lowest.
pub const DIRECTIONS: [[u32; 4]; INDEX_BITS as usize] = directions();

/// The numbers of one sample. All are uniform in [0, 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleNumbers {
    /// The choice of a light (the first two) and of a point on it (the last two).
    pub light: [f32; 4],
    /// The position within the pixel.
    pub jitter: [f32; 2],
    /// Which of several candidates is kept.
    pub choice: f32,
}

/// The sequence of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelSequence {
    /// The index of the pixel's first sample in the sequence of its tile.
    first: u32,
    /// Samples of the pixel before its block ends: a power of two, minus one.
    block_mask: u32,
    block_bits: u32,
    /// The tile and the seed of the picture.
    key: [u32; 3],
}

impl PixelSequence {
    /// The sequence of the pixel (x, y) in a picture of `spp` samples per pixel.
    ///
    /// More samples than `spp` can be taken: after the block of a pixel, which has the next power
    /// of two, another scramble begins.
    pub fn new(x: u32, y: u32, spp: u32, seed: u32) -> Self {
        let block_bits = block_bits(spp);
        let tile_bits = tile_bits(block_bits);
        let mask = (1 << tile_bits) - 1;
        let first = (spread_bits(x & mask) | spread_bits(y & mask) << 1) << block_bits;
        Self { first, block_mask: (1 << block_bits) - 1, block_bits, key: [x >> tile_bits, y >> tile_bits, seed] }
    }

    /// The numbers of a sample.
    pub fn sample(&self, sample: u32) -> SampleNumbers {
        let [x, y, seed] = self.key;
        let round = if self.block_bits < INDEX_BITS { sample >> self.block_bits } else { 0 };
        let scramble = pcg4d([x, y, seed, round]);
        let index = self.first | sample & self.block_mask;
        let light = point(index, scramble[0], scramble[1]);
        let [jitter_x, jitter_y, _, choice] = point(index, scramble[2], scramble[3]);
        SampleNumbers { light, jitter: [jitter_x, jitter_y], choice }
    }
}

/// The bits of an index that number the samples of a pixel.
pub fn block_bits(spp: u32) -> u32 {
    spp.max(1).next_power_of_two().trailing_zeros()
}

/// The bits of a pixel's coordinate within its tile.
pub fn tile_bits(block_bits: u32) -> u32 {
    MAX_TILE_BITS.min((INDEX_BITS - block_bits) / 2)
}

/// The seed of a frame, from the seed of the run.
pub fn frame_seed(seed: u64, frame: u32) -> u32 {
    pcg4d([seed as u32, (seed >> 32) as u32, frame, 0x51ed_270b])[3]
}

/// A scrambled point of the shuffled sequence.
fn point(index: u32, shuffle: u32, scramble: u32) -> [f32; 4] {
    let index = scramble_reversed(index.reverse_bits(), shuffle).reverse_bits();
    let mut bits = [0; 4];
    for (bit, directions) in DIRECTIONS.iter().enumerate() {
        let is_set = 0u32.wrapping_sub(index >> bit & 1);
        for (bits, direction) in bits.iter_mut().zip(directions) {
            *bits ^= direction & is_set;
        }
    }
    // 24 bits are exact in a float, so that the result is below 1.
    let number = |(bits, dimension): (u32, u32)| {
        let seed = scramble.wrapping_add(dimension.wrapping_mul(0x9e37_79b9));
        (scramble_reversed(bits.reverse_bits(), mix(seed)).reverse_bits() >> 8) as f32 * (1.0 / 16_777_216.0)
    };
    [(bits[0], 0), (bits[1], 1), (bits[2], 2), (bits[3], 3)].map(number)
}

/// Flips each bit by a hash of the bits below it: on reversed bits, an Owen scramble in base two.
fn scramble_reversed(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul(seed >> 16 | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

/// A hash of one word, by which the dimensions get scrambles of their own (Wang, 2007).
fn mix(mut x: u32) -> u32 {
    x = (x ^ 61) ^ x >> 16;
    x = x.wrapping_mul(9);
    x ^= x >> 4;
    x = x.wrapping_mul(0x27d4_eb2d);
    x ^ x >> 15
}

/// Moves each of the lower 16 bits to twice its position.
fn spread_bits(mut x: u32) -> u32 {
    x = (x | x << 8) & 0x00ff_00ff;
    x = (x | x << 4) & 0x0f0f_0f0f;
    x = (x | x << 2) & 0x3333_3333;
    (x | x << 1) & 0x5555_5555
}

/// The direction numbers of up to five dimensions: the first one reverses the bits, the others follow recurrences.
pub const fn directions<const DIMENSIONS: usize>() -> [[u32; DIMENSIONS]; INDEX_BITS as usize] {
    // The degree of the primitive polynomial, its inner coefficients, and the initial numbers.
    const POLYNOMIALS: [(usize, u32, [u32; 3]); 4] =
        [(1, 0, [1, 0, 0]), (2, 1, [1, 3, 0]), (3, 1, [1, 3, 1]), (3, 2, [1, 1, 1])];
    let mut table = [[0; DIMENSIONS]; INDEX_BITS as usize];
    let mut bit = 0;
    while bit < INDEX_BITS as usize {
        table[bit][0] = 1 << (INDEX_BITS - 1 - bit as u32);
        let mut dimension = 1;
        while dimension < DIMENSIONS {
            let (degree, coefficients, initial) = POLYNOMIALS[dimension - 1];
            table[bit][dimension] = if bit < degree {
                initial[bit] << (INDEX_BITS - 1 - bit as u32)
            } else {
                let oldest = table[bit - degree][dimension];
                let mut number = oldest ^ oldest >> degree;
                let mut term = 1;
                while term < degree {
                    if coefficients >> (degree - 1 - term) & 1 == 1 {
                        number ^= table[bit - term][dimension];
                    }
                    term += 1;
                }
                number
            };
            dimension += 1;
        }
        bit += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All numbers of a sample.
    fn numbers(sample: SampleNumbers) -> [f32; 7] {
        let SampleNumbers { light: [a, b, c, d], jitter: [x, y], choice } = sample;
        [a, b, c, d, x, y, choice]
    }

    /// Whether values fill each of as many equal intervals once.
    fn is_stratified(values: impl Iterator<Item = f32>) -> bool {
        let values: Vec<f32> = values.collect();
        let mut seen = vec![false; values.len()];
        values.iter().for_each(|x| seen[(x * values.len() as f32) as usize] = true);
        seen.into_iter().all(|seen| seen)
    }

    #[test]
    fn the_first_points_are_those_of_sobol() {
        let of = |index: u32| {
            let set = (0..32).filter(|bit| index >> bit & 1 == 1);
            let mut bits = [0; 4];
            set.for_each(|bit| (0..4).for_each(|dimension| bits[dimension] ^= DIRECTIONS[bit][dimension]));
            bits.map(|bits: u32| f64::from(bits) / 4_294_967_296.0)
        };
        // Joe and Kuo list the points in the order of the Gray code: 1, 3, 2, 6.
        assert_eq!(of(1), [0.5, 0.5, 0.5, 0.5]);
        assert_eq!(of(3), [0.75, 0.25, 0.25, 0.25]);
        assert_eq!(of(2), [0.25, 0.75, 0.75, 0.75]);
        assert_eq!(of(6), [0.375, 0.375, 0.625, 0.875]);
    }

    #[test]
    fn the_samples_of_a_pixel_are_stratified() {
        for (spp, seed) in [(1, 1), (4, 2), (16, 3), (64, 4), (1 << 20, 5)] {
            let sequence = PixelSequence::new(37, 1030, spp, seed);
            let samples: Vec<[f32; 7]> = (0..spp.min(256)).map(|i| numbers(sequence.sample(i))).collect();
            for dimension in 0..7 {
                assert!(is_stratified(samples.iter().map(|u| u[dimension])), "{spp} samples, dimension {dimension}");
            }
            // Elementary intervals of the first two dimensions of both sets: a (0, 2) sequence.
            let count = samples.len() as f32;
            for [x, y] in [[0, 1], [4, 5]] {
                let mut columns = 1.0;
                while columns <= count {
                    let rows = count / columns;
                    let cell = |u: &[f32; 7]| ((u[x] * columns).floor() * rows + (u[y] * rows).floor()) as usize;
                    let mut cells: Vec<usize> = samples.iter().map(cell).collect();
                    cells.sort_unstable();
                    assert!(cells.iter().copied().eq(0..samples.len()), "{spp} samples, {columns} columns");
                    columns *= 2.0;
                }
            }
        }
    }

    #[test]
    fn the_samples_of_a_square_of_pixels_are_stratified_together() {
        for side in [2, 4, 8] {
            let pixels = (0..side * side).map(|i| PixelSequence::new(640 + i % side, 16 + i / side, 1, 9));
            let samples: Vec<[f32; 7]> = pixels.map(|pixel| numbers(pixel.sample(0))).collect();
            for dimension in 0..7 {
                assert!(is_stratified(samples.iter().map(|u| u[dimension])), "side {side}, dimension {dimension}");
            }
        }
    }

    #[test]
    fn pixels_tiles_seeds_and_rounds_differ() {
        let sample = |x, y, seed, index| numbers(PixelSequence::new(x, y, 4, seed).sample(index));
        let base = sample(3, 5, 1, 2);
        for other in [sample(4, 5, 1, 2), sample(3, 5 + 1024, 1, 2), sample(3, 5, 2, 2), sample(3, 5, 1, 6)] {
            assert!(base.iter().zip(&other).all(|(a, b)| a != b), "{base:?} {other:?}");
        }
    }

    #[test]
    fn the_mean_of_each_number_is_a_half() {
        // Pixels 1024 apart have independent scrambles, and 3 samples of a block of 4 are not
        // balanced: the standard deviation of the mean of 4000 pixels is below
        // sqrt(1 / 12 / 4000) = 0.0046. Five of them have a false-alarm rate of 4e-6 for 7 numbers.
        let mut mean = [0.0; 7];
        for pixel in 0..4000 {
            let sequence = PixelSequence::new(pixel * 1024, 7, 4, 3);
            for (m, x) in mean.iter_mut().zip(
                (0..3)
                    .map(|i| numbers(sequence.sample(i)))
                    .fold([0.0; 7], |sum, u| std::array::from_fn(|i| sum[i] + f64::from(u[i]) / 3.0)),
            ) {
                *m += x / 4000.0;
            }
        }
        assert!(mean.iter().all(|m: &f64| (m - 0.5).abs() < 0.023), "{mean:?}");
    }
}

//! The random numbers of measuring programs: Roberts' R sequences (2018), shifted by a hash of the
//! pixel. Each sample is uniform, and the samples of a pixel are evenly distributed, which lowers
//! the noise without bias.

use super::hash::pcg4d;

/// What random numbers are used for. Those of different dimensions are independent.
#[derive(Clone, Copy, Debug)]
#[repr(u32)]
pub enum Dimension {
    /// The choice of a light (x, y) and of a point on it (z, w).
    Light = 0,
    /// Everything else.
    Pixel = 1,
}

/// Fractional parts of the powers of 1/phi_4 times 2^32, where phi_d is the root of x^(d+1) = x +
/// 1.
const R4: [u32; 4] = [0xdb4f_0b91, 0xbbe0_5633, 0xa0f2_ec76, 0x89e1_8285];
/// The same for phi_2, twice.
const R2: [u32; 4] = [0xc13f_a9a9, 0x91e1_0da6, 0xc13f_a9a9, 0x91e1_0da6];

/// Four random numbers in [0, 1), which depend on the arguments only.
pub fn random(pixel: u32, sample: u32, seed: u32, dimension: Dimension) -> [f32; 4] {
    let shift = pcg4d([pixel, seed, dimension as u32, 0x9e37_79b9]);
    let steps = if matches!(dimension, Dimension::Light) { R4 } else { R2 };
    // 24 bits are exact in a float, so that the result is below 1.
    std::array::from_fn(|i| (shift[i].wrapping_add(sample.wrapping_mul(steps[i])) >> 8) as f32 * (1.0 / 16_777_216.0))
}

#[cfg(test)]
mod tests {
    #[test]
    fn random_numbers_are_below_one_and_uniform_in_the_mean() {
        let mut mean = [0.0f64; 4];
        for pixel in 0..1000 {
            for sample in 0..16 {
                let u = super::random(pixel, sample, 3, super::Dimension::Light);
                for (m, x) in mean.iter_mut().zip(u) {
                    assert!((0.0..1.0).contains(&x));
                    *m += f64::from(x) / 16_000.0;
                }
            }
        }
        for m in mean {
            // 1000 independent shifts: the mean's deviation is at most sqrt(1/12/1000) = 0.009.
            assert!((m - 0.5).abs() < 0.04, "{mean:?}");
        }
    }
}

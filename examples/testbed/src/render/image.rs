//! What a renderer returns: a picture, and numbers of shadow rays.

use girandole::glam::{Vec3, Vec4};
use girandole::light::luminance;
use std::ops::Add;

/// Radiance in nits, linear Rec. 709, row by row from the top.
#[derive(Clone, Debug)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `width` times `height` pixels.
    pub pixels: Vec<Vec3>,
    /// An estimate of the square of the standard error of each pixel's luminance.
    pub variance: Vec<f32>,
}

impl Image {
    /// A picture from the sums of radiance (xyz) over `spp` samples of each pixel, and of luminance (w)
    /// over the first half of them, [`first_half`].
    ///
    /// The halves of a pixel's samples are evenly distributed each, so the difference of their means
    /// shows the error of well-spread samples. Their variance would show a larger one.
    pub fn from_sums(width: u32, height: u32, spp: u32, sums: impl Iterator<Item = Vec4>) -> Self {
        let count = spp as f32;
        let first = first_half(spp) as f32;
        let (pixels, variance) = sums
            .map(|sum| {
                let mean = sum.truncate() / count;
                let whole = luminance(sum.truncate());
                // One sample does not show its error; it is then taken to be as large as the
                // sample.
                let variance = if spp > 1 {
                    (0.5 * (sum.w / first - (whole - sum.w) / (count - first))).powi(2)
                } else {
                    luminance(mean).powi(2)
                };
                (mean, variance)
            })
            .unzip();
        Self { width, height, pixels, variance }
    }
}

/// The number of samples in the first half of `spp`: half, rounded up to a power of two, but not all
/// of them.
pub fn first_half(spp: u32) -> u32 {
    (spp / 2).max(1).next_power_of_two()
}

/// Numbers of shadow rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShadowRays {
    /// Rays that were traced.
    pub traced: u64,
    /// Rays that were not traced, because nothing could block them.
    pub skipped: u64,
}

impl Add for ShadowRays {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { traced: self.traced + other.traced, skipped: self.skipped + other.skipped }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_half_is_a_power_of_two_and_leaves_samples_to_the_second() {
        assert_eq!([1, 2, 3, 4, 5, 6, 7, 8, 16, 20, 64].map(first_half), [1, 1, 1, 2, 2, 4, 4, 4, 8, 16, 32]);
        assert!((2..1000).all(|spp| first_half(spp) < spp));
    }

    #[test]
    fn the_error_is_half_the_difference_of_the_halves() {
        // Grey samples 1, 2, 3 and 6: the halves have the means 1.5 and 4.5.
        let sums = Vec3::splat(12.0).extend(3.0);
        let image = Image::from_sums(1, 1, 4, std::iter::once(sums));
        assert!((image.pixels[0] - Vec3::splat(3.0)).abs().max_element() < 1e-6);
        assert!((image.variance[0] - 1.5 * 1.5).abs() < 1e-5, "{}", image.variance[0]);
        let single = Image::from_sums(1, 1, 1, std::iter::once(Vec3::splat(2.0).extend(2.0)));
        assert!((single.variance[0] - 4.0).abs() < 1e-5);
    }
}

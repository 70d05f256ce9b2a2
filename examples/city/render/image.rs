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
    /// The square of the standard error of each pixel's luminance.
    pub variance: Vec<f32>,
}

impl Image {
    /// A picture from the sums of radiance (xyz) and of squared luminance (w) over `spp` samples of
    /// each pixel.
    pub fn from_sums(width: u32, height: u32, spp: u32, sums: impl Iterator<Item = Vec4>) -> Self {
        let count = spp as f32;
        let (pixels, variance) = sums
            .map(|sum| {
                let mean = sum.truncate() / count;
                let square = luminance(mean).powi(2);
                // One sample does not show its error; it is then taken to be as large as the
                // sample.
                let variance = if spp > 1 { (sum.w / count - square).max(0.0) / (count - 1.0) } else { square };
                (mean, variance)
            })
            .unzip();
        Self { width, height, pixels, variance }
    }
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

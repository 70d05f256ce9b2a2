//! A rendered picture.

use girandole::glam::{Vec3, Vec4};
use girandole::light::luminance;

/// Radiance in nits, linear Rec. 709, row by row from the top.
#[derive(Clone, Debug)]
pub struct Image {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// `width` times `height` of them.
    pub pixels: Vec<Vec3>,
    /// The square of each pixel's standard error, in luminance: how noisy it is.
    pub variance: Vec<f32>,
}

impl Image {
    /// From each pixel's summed radiance and summed squared luminance over `spp` samples.
    pub fn from_sums(width: u32, height: u32, spp: u32, sums: impl Iterator<Item = Vec4>) -> Self {
        let count = spp as f32;
        let (pixels, variance) = sums
            .map(|sum| {
                let mean = sum.truncate() / count;
                let square = luminance(mean).powi(2);
                // One sample says nothing about its noise: then it is as large as the sample.
                let variance = if spp > 1 { (sum.w / count - square).max(0.0) / (count - 1.0) } else { square };
                (mean, variance)
            })
            .unzip();
        Self { width, height, pixels, variance }
    }
}

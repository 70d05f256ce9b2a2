//! The error of pictures against a reference.

use girandole::glam::Vec3;
use girandole::light::luminance;

/// The share of the reference's mean that is added to each pixel of the reference before errors are
/// divided by it, so that black pixels do not decide.
const FLOOR: f64 = 0.01;
/// relMSE leaves out one in so many pixels, those with the largest errors. Otherwise a few pixels
/// would decide it, and it would differ from run to run by a factor of several.
const TRIM: usize = 1_000;

/// The errors of one picture, of luminance before tone mapping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// The mean over all pixels of `|I - R| / (0.01 mean(R) + R)` for a picture I and a reference
    /// R.
    pub mape: f64,
    /// The mean of the squares of these fractions over 99.9 % of the pixels.
    pub rel_mse: f64,
    /// The mean of the picture over the mean of the reference.
    pub mean: f64,
}

impl Score {
    /// Compares a picture with a reference of the same size that is not black.
    pub fn new(picture: &[Vec3], reference: &[Vec3]) -> Self {
        let floor = FLOOR * mean(reference);
        let error = |(pixel, reference): (&Vec3, &Vec3)| {
            let reference = f64::from(luminance(*reference));
            (f64::from(luminance(*pixel)) - reference).abs() / (floor + reference)
        };
        let mut errors: Vec<f64> = picture.iter().zip(reference).map(error).collect();
        errors.sort_by(f64::total_cmp);
        let kept = &errors[..errors.len() - errors.len() / TRIM];
        Self {
            mape: errors.iter().sum::<f64>() / errors.len() as f64,
            rel_mse: kept.iter().map(|error| error * error).sum::<f64>() / kept.len() as f64,
            mean: mean(picture) / mean(reference),
        }
    }
}

/// The mean luminance of a picture.
pub fn mean(picture: &[Vec3]) -> f64 {
    picture.iter().map(|pixel| f64::from(luminance(*pixel))).sum::<f64>() / picture.len() as f64
}

/// Pictures per sampler, which differ in their random numbers.
pub const PICTURES: usize = 4;
/// Student's t for 95 % and three degrees of freedom, both sides together.
const T: f64 = 3.182;

/// The mean of an error over pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    pub mean: f64,
    /// Half of the width of the 95 % confidence interval.
    pub half_width: f64,
}

impl Estimate {
    /// Estimates from the errors of all pictures.
    pub fn new(errors: [f64; PICTURES]) -> Self {
        let count = PICTURES as f64;
        let mean = errors.iter().sum::<f64>() / count;
        let variance = errors.iter().map(|error| (error - mean).powi(2)).sum::<f64>() / (count - 1.0);
        Self { mean, half_width: T * (variance / count).sqrt() }
    }
}

impl std::fmt::Display for Estimate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.3} ± {:.3}", self.mean, self.half_width)
    }
}

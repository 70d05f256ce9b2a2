//! The error of pictures against a reference.

use girandole::glam::Vec3;
use girandole::light::luminance;

/// The share of the reference's mean that is added to each pixel of the reference before errors are
/// divided by it, so that black pixels do not decide.
pub const FLOOR: f64 = 0.01;
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
    /// The same over all pixels.
    pub rel_mse_of_all: f64,
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
        let mean_square = |errors: &[f64]| errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64;
        Self {
            mape: errors.iter().sum::<f64>() / errors.len() as f64,
            rel_mse: mean_square(kept),
            rel_mse_of_all: mean_square(&errors),
            mean: mean(picture) / mean(reference),
        }
    }
}

/// The mean luminance of a picture.
pub fn mean(picture: &[Vec3]) -> f64 {
    picture.iter().map(|pixel| f64::from(luminance(*pixel))).sum::<f64>() / picture.len() as f64
}

/// Student's t for 95 %, both sides together, for 1 to 30 degrees of freedom.
const T: [f64; 30] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131, 2.120,
    2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042,
];

/// The mean of independent values, with its 95 % confidence interval by Student's t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    pub mean: f64,
    /// Half of the width of the interval; infinite for a single value.
    pub half_width: f64,
}

impl Estimate {
    /// Estimates from at least one value.
    pub fn new(values: &[f64]) -> Self {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        if values.len() < 2 {
            return Self { mean, half_width: f64::INFINITY };
        }
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
        // Beyond the table, its last entry is too wide by at most 4 %.
        let t = T[(values.len() - 2).min(T.len() - 1)];
        Self { mean, half_width: t * (variance / count).sqrt() }
    }

    /// The lower end of the interval.
    pub fn low(&self) -> f64 {
        self.mean - self.half_width
    }

    /// The upper end of the interval.
    pub fn high(&self) -> f64 {
        self.mean + self.half_width
    }

    /// The ends of the interval for a mean that cannot be negative, such as that of errors.
    ///
    /// It is the interval of the logarithm of the mean, to first order, so both ends are above 0.
    /// For half-widths that are small beside the mean it is that of [`Estimate::low`] and
    /// [`Estimate::high`].
    pub fn positive_interval(&self) -> [f64; 2] {
        if self.mean <= 0.0 {
            return [0.0, self.half_width];
        }
        let spread = self.half_width / self.mean;
        [self.mean * (-spread).exp(), self.mean * spread.exp()]
    }
}

impl std::fmt::Display for Estimate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.3} ± {:.3}", self.mean, self.half_width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_of_an_error_stays_above_zero() {
        let wide = Estimate { mean: 2.0, half_width: 6.0 };
        let [low, high] = wide.positive_interval();
        assert!(wide.low() < 0.0);
        assert!((low * high - 4.0).abs() < 1e-12 && (high - 2.0 * 3.0_f64.exp()).abs() < 1e-12, "{low}, {high}");
        let [low, high] = Estimate { mean: 2.0, half_width: 0.01 }.positive_interval();
        assert!((low - 1.99).abs() < 1e-4 && (high - 2.01).abs() < 1e-4, "{low}, {high}");
        assert_eq!(Estimate { mean: 0.0, half_width: 0.0 }.positive_interval(), [0.0, 0.0]);
    }
}

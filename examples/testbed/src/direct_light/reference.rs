//! The converged picture that errors are measured against, as a mean of passes, and its own error.

use girandole::glam::{DVec3, Vec3};
use girandole::light::luminance;

/// Passes of equal weight, summed up: three channels, and the squared luminance.
pub struct Reference {
    passes: f64,
    sums: Vec<(DVec3, f64)>,
}

impl Reference {
    /// Sums up passes, which must be independent of each other.
    pub fn new(pixels: usize, passes: impl Iterator<Item = Vec<Vec3>>) -> Self {
        let mut reference = Self { passes: 0.0, sums: vec![(DVec3::ZERO, 0.0); pixels] };
        for pass in passes {
            for ((sum, squares), pixel) in reference.sums.iter_mut().zip(&pass) {
                *sum += pixel.as_dvec3();
                *squares += f64::from(luminance(*pixel)).powi(2);
            }
            reference.passes += 1.0;
        }
        reference
    }

    /// The mean of all passes; black without any.
    pub fn picture(&self) -> Vec<Vec3> {
        let per_pass = 1.0 / self.passes.max(1.0);
        self.sums.iter().map(|(sum, _)| (*sum * per_pass).as_vec3()).collect()
    }

    /// The squared standard error of the luminance of each pixel, as far as the passes show it.
    /// Infinite below two passes.
    pub fn variance(&self) -> Vec<f64> {
        let of = |(sum, squares): &(DVec3, f64)| {
            let mean = f64::from(luminance((*sum / self.passes).as_vec3()));
            (squares / self.passes - mean * mean).max(0.0) / (self.passes - 1.0)
        };
        if self.passes < 2.0 { vec![f64::INFINITY; self.sums.len()] } else { self.sums.iter().map(of).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reference_is_the_mean_of_its_passes_and_knows_their_spread() {
        let passes = [1.0, 3.0].map(|gray| vec![Vec3::splat(gray), Vec3::ZERO]);
        let reference = Reference::new(2, passes.into_iter());
        assert_eq!(reference.picture(), [Vec3::splat(2.0), Vec3::ZERO]);
        // Luminances 1 and 3: their variance is 2, that of their mean 1.
        assert!((reference.variance()[0] - 1.0).abs() < 1e-6 && reference.variance()[1] == 0.0);
        assert_eq!(Reference::new(1, std::iter::once(vec![Vec3::ONE])).variance(), [f64::INFINITY]);
    }
}

//! The noise of a picture as colours.

use super::colors::{NOTHING, inferno};
use girandole::light::luminance;
use rayon::prelude::*;
use testbed::render::image::Image;

/// Relative standard errors at the dark and the bright end of the colours, as exponents of two:
/// 1/64 and 4.
pub const RANGE: [f32; 2] = [-6.0, 2.0];

/// The relative standard error of each pixel's luminance: three sRGB bytes per pixel. Pixels that are
/// `clear` have none.
pub fn noise_picture(image: &Image, clear: &[bool]) -> Vec<u8> {
    let pixels = image.pixels.par_iter().zip(&image.variance).zip(clear);
    pixels
        .flat_map_iter(|((pixel, variance), is_clear)| {
            if *is_clear {
                return NOTHING;
            }
            let mean = luminance(*pixel);
            let error = if mean > 0.0 { variance.max(0.0).sqrt() / mean } else { 0.0 };
            inferno((error.log2() - RANGE[0]) / (RANGE[1] - RANGE[0]))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use girandole::glam::Vec3;

    #[test]
    fn noise_is_shown_on_a_logarithmic_scale() {
        let picture = Image {
            width: 4,
            height: 1,
            pixels: vec![Vec3::splat(2.0), Vec3::splat(2.0), Vec3::ZERO, Vec3::ONE],
            // Relative errors of 4 and 1/4.
            variance: vec![64.0, 0.25, 1.0, 1.0],
        };
        let expected = [inferno(1.0), inferno(0.5), inferno(0.0), NOTHING].concat();
        assert_eq!(noise_picture(&picture, &[false, false, false, true]), expected);
    }
}

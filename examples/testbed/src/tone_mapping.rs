//! Tone mapping, from radiance to a picture for a screen: exposure, bloom around lamps, and the AgX
//! curve.
//!
//! The curve is Benjamin Wrensch's minimal fit (2023) of Troy Sobotka's AgX with its "punchy" look.
//! Bright saturated lamps turn white instead of clipping to a flat colour. Only PNG pictures are
//! tone mapped.

use super::render::image::Image;
use girandole::glam::{Mat3, Vec3};
use rayon::prelude::*;

/// Share of the light that the bloom scatters, as a lens does.
const BLOOM: f32 = 0.045;
/// Radii of the bloom as shares of the picture's height, and their weights.
const BLOOM_LOBES: [(f32, f32); 3] = [(0.006, 0.5), (0.02, 0.3), (0.07, 0.2)];
/// Exposed values are limited to this before they are scattered, so that a single noisy pixel does
/// not cover the picture.
const BLOOM_LIMIT: f32 = 40.0;

/// Linear Rec. 709 to the space of the curve.
const INSET: Mat3 = Mat3::from_cols_array(&[
    0.842_479_06,
    0.042_328_242,
    0.042_375_655,
    0.078_433_6,
    0.878_468_6,
    0.078_433_6,
    0.079_223_745,
    0.079_166_13,
    0.879_143,
]);
/// The space of the curve to linear Rec. 709.
const OUTSET: Mat3 = Mat3::from_cols_array(&[
    1.196_879,
    -0.052_896_85,
    -0.052_971_635,
    -0.098_020_88,
    1.151_903_1,
    -0.098_043_45,
    -0.099_029_74,
    -0.098_961_18,
    1.151_073_7,
]);
/// Lower end of the curve, in powers of two.
const MIN_EV: f32 = -12.473_93;
/// Upper end of the curve, in powers of two.
const MAX_EV: f32 = 4.026_069;
/// Contrast of the look.
const PUNCHY_POWER: f32 = 1.25;
/// Saturation of the look.
const PUNCHY_SATURATION: f32 = 1.35;

/// A picture for an sRGB screen: three bytes per pixel, row by row from the top.
pub fn tone_map(image: &Image, exposure: f32) -> Vec<u8> {
    let (width, height) = (image.width as usize, image.height as usize);
    let exposed: Vec<Vec3> = image.pixels.par_iter().map(|p| (*p * exposure).max(Vec3::ZERO)).collect();
    let mut glow = vec![Vec3::ZERO; exposed.len()];
    let bright: Vec<Vec3> = exposed.par_iter().map(|p| p.min(Vec3::splat(BLOOM_LIMIT))).collect();
    for (width_share, weight) in BLOOM_LOBES {
        let radius = (width_share * height as f32).round().max(1.0) as usize;
        // Three successive box filters approximate a Gaussian, at a cost that does not depend on
        // the radius.
        let mut blurred = bright.clone();
        for _ in 0..3 {
            blurred = blur_rows(&blurred, width, radius);
            blurred = transpose(&blur_rows(&transpose(&blurred, width), height, radius), height);
        }
        glow.par_iter_mut().zip(&blurred).for_each(|(sum, p)| *sum += *p * weight);
    }
    exposed
        .par_iter()
        .zip(&glow)
        .flat_map_iter(|(p, g)| {
            let encoded = agx(*p * (1.0 - BLOOM) + *g * BLOOM);
            encoded.to_array().map(|x| (x * 255.0 + 0.5) as u8)
        })
        .collect()
}

/// The AgX curve: exposed linear Rec. 709 to sRGB values in [0, 1].
pub fn agx(linear: Vec3) -> Vec3 {
    let logarithm = (INSET * linear).max(Vec3::splat(1e-10)).map(f32::log2);
    let x = ((logarithm - MIN_EV) / (MAX_EV - MIN_EV)).clamp(Vec3::ZERO, Vec3::ONE);
    let x2 = x * x;
    let x4 = x2 * x2;
    let curve = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    let contrast = curve.max(Vec3::ZERO).powf(PUNCHY_POWER);
    let gray = contrast.dot(Vec3::new(0.2126, 0.7152, 0.0722));
    let look = Vec3::splat(gray) + (contrast - gray) * PUNCHY_SATURATION;
    (OUTSET * look).clamp(Vec3::ZERO, Vec3::ONE)
}

/// Averages each pixel with those of its row within `radius`.
fn blur_rows(source: &[Vec3], width: usize, radius: usize) -> Vec<Vec3> {
    let mut result = vec![Vec3::ZERO; source.len()];
    let scale = 1.0 / (2 * radius + 1) as f32;
    result.par_chunks_mut(width).zip(source.par_chunks(width)).for_each(|(to, from)| {
        // Beyond its sides the picture repeats its last pixel.
        let at = |x: isize| from[x.clamp(0, width as isize - 1) as usize];
        let r = radius as isize;
        let mut sum: Vec3 = (-r..=r).map(at).sum();
        for (x, value) in to.iter_mut().enumerate() {
            *value = sum.max(Vec3::ZERO) * scale;
            let x = x as isize;
            sum += at(x + r + 1) - at(x - r);
        }
    });
    result
}

fn transpose(source: &[Vec3], width: usize) -> Vec<Vec3> {
    let height = source.len() / width;
    let mut result = vec![Vec3::ZERO; source.len()];
    result.par_chunks_mut(height).enumerate().for_each(|(x, column)| {
        for (y, value) in column.iter_mut().enumerate() {
            *value = source[y * width + x];
        }
    });
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_stays_dark_and_a_lamp_turns_white() {
        let picture =
            |width, height, pixels: Vec<Vec3>| Image { width, height, variance: vec![0.0; pixels.len()], pixels };
        let image = picture(2, 1, vec![Vec3::ZERO, Vec3::splat(1e5)]);
        let bytes = tone_map(&image, 1.0);
        assert!(bytes[3..].iter().all(|&b| b > 240), "{bytes:?}");
        let dark = tone_map(&picture(2, 2, vec![Vec3::ZERO; 4]), 1.0);
        assert!(dark.iter().all(|&b| b < 4), "{dark:?}");
    }
}

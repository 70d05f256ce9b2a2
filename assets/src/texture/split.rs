//! Cuts surfaces into parts, smaller where their texels differ.
//!
//! A part is chosen by its flux, and a point on it evenly. If what the point emits is the colour of its texel, then the
//! relative variance of the estimate of what all parts emit is the sum of their `noise` over the sum of
//! their `flux`.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use girandole::light::luminance;
use glam::Vec3;

use super::image::Texture;
use super::surface::TexturedSurface;

/// Below this share of the flux, the noise of a part is that of rounding.
const ROUNDING: f64 = 1e-5;

/// The noise of a part, and its flux: numbers of at least 0.
fn noise_and_flux(texture: &mut Texture<'_>, surface: &TexturedSurface) -> [f64; 2] {
    let mean = texture.average(surface);
    // What is emitted of the luminance: the colour of the surface is left out where it is the same everywhere.
    let (first, second) = (f64::from(luminance(mean.truncate().as_vec3())), mean.w);
    let flux = surface.area() * f64::from(luminance(surface.light(Vec3::ONE).emission)) * first;
    let noise = flux * (second / (first * first) - 1.0);
    let is_noise = noise > flux * ROUNDING && noise.is_finite();
    [if is_noise { noise } else { 0.0 }, if flux > 0.0 { flux } else { 0.0 }]
}

impl Texture<'_> {
    /// Cuts surfaces into parts, by four, the noisiest first. Dark parts are among them.
    ///
    /// It ends when the texels within parts add a relative standard deviation of at most `noise` to a sample of all that
    /// the surfaces emit, or when no more than three are missing to `max_parts`; no part is smaller than needed for
    /// that. Surfaces themselves are never too many. A `noise` of 0.3 is little beside the noise of shadows and of
    /// distances.
    ///
    /// O(texels log(parts)), as for [`Texture::light`].
    pub fn split(&mut self, surfaces: &[TexturedSurface], noise: f32, max_parts: usize) -> Vec<TexturedSurface> {
        let mut parts = surfaces.to_vec();
        let [mut left, mut flux] = [0.0; 2];
        // The bits of the noise of each part, which are in its order, and the place of the part: the first of equal ones.
        let mut heap = BinaryHeap::with_capacity(surfaces.len());
        for (place, surface) in surfaces.iter().enumerate() {
            let [noise, of_part] = noise_and_flux(self, surface);
            (left, flux) = (left + noise, flux + of_part);
            heap.push((noise.to_bits(), Reverse(place)));
        }
        let enough = flux * f64::from(noise).powi(2);
        while left > enough && parts.len() + 3 <= max_parts {
            let Some((noisiest, Reverse(place))) = heap.pop().filter(|(noise, _)| *noise > 0) else { break };
            left -= f64::from_bits(noisiest);
            let places = [place, parts.len(), parts.len() + 1, parts.len() + 2];
            let quarters = parts[place].quarters();
            parts[place] = quarters[0];
            parts.extend(&quarters[1..]);
            for (place, quarter) in places.into_iter().zip(&quarters) {
                let [noise, _] = noise_and_flux(self, quarter);
                left += noise;
                heap.push((noise.to_bits(), Reverse(place)));
            }
        }
        parts
    }
}

//! Cuts surfaces into parts, smaller where their texels differ.
//!
//! A part is chosen by its flux, and a point on it evenly. If what the point emits is the colour of its texel, then the
//! relative variance of the estimate of what all parts emit is the sum of their `noise` over the sum of
//! their `flux`.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use glam::Vec3;

use super::image::Texture;
use super::surface::TexturedSurface;
use crate::light::luminance;

/// Below this share of the flux, the noise of a part is that of rounding.
const ROUNDING: f64 = 1e-5;

/// A part, which may be cut.
struct Part {
    noise: f64,
    flux: f64,
    /// Its place among the parts.
    place: usize,
}

impl Part {
    fn new(texture: &mut Texture<'_>, surface: &TexturedSurface, place: usize) -> Self {
        let mean = texture.average(surface);
        // What is emitted of the luminance: the colour of the surface is left out where it is the same everywhere.
        let (first, second) = (f64::from(luminance(mean.truncate().as_vec3())), mean.w);
        let flux = surface.area() * f64::from(luminance(surface.light(Vec3::ONE).emission)) * first;
        let noise = flux * (second / (first * first) - 1.0);
        let is_noise = noise > flux * ROUNDING && noise.is_finite();
        Self { noise: if is_noise { noise } else { 0.0 }, flux: if flux > 0.0 { flux } else { 0.0 }, place }
    }
}

impl PartialEq for Part {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Part {}

impl PartialOrd for Part {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Part {
    fn cmp(&self, other: &Self) -> Ordering {
        self.noise.total_cmp(&other.noise).then(other.place.cmp(&self.place))
    }
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
        let first = surfaces.iter().enumerate();
        let mut heap: BinaryHeap<Part> = first.map(|(place, surface)| Part::new(self, surface, place)).collect();
        let sum = |of: fn(&Part) -> f64| heap.iter().map(of).sum::<f64>();
        let (mut left, flux) = (sum(|part| part.noise), sum(|part| part.flux));
        let enough = flux * f64::from(noise).powi(2);
        while left > enough && parts.len() + 3 <= max_parts {
            let Some(noisiest) = heap.pop().filter(|part| part.noise > 0.0) else { break };
            left -= noisiest.noise;
            for (number, quarter) in parts[noisiest.place].quarters().into_iter().enumerate() {
                let place = if number == 0 { noisiest.place } else { parts.len() };
                if number == 0 {
                    parts[place] = quarter
                } else {
                    parts.push(quarter)
                }
                let part = Part::new(self, &quarter, place);
                left += part.noise;
                heap.push(part);
            }
        }
        parts
    }
}

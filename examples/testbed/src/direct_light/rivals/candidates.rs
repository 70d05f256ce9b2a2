//! Resampling: candidates with estimates of their light, of which a reservoir keeps one.

use super::points::LightPoint;
use crate::common::alias::Alias;
use crate::common::split_mix;
use crate::direct_light::draw::{Drawn, Sample};
use crate::direct_light::view::Surface;
use crate::render::shading::brdf;
use crate::scene::Material;
use girandole::light::luminance;
use girandole::{Light, LightId, LightSampler};

/// The pixels of a frame that shares what does not grow with a picture: measured pictures are smaller
/// than what players see.
pub const FULL_HD: f64 = 1_920.0 * 1_080.0;

/// Random numbers for candidates, of which samples need more than they come with.
pub struct Random(u64);

impl Random {
    /// A stream of its own for each list of words.
    pub fn new(words: &[u32]) -> Self {
        Self(words.iter().fold(words.len() as u64, |state, word| split_mix::mix(state ^ u64::from(*word))))
    }

    /// The stream of a sample.
    pub fn of_sample(sample: &Sample) -> Self {
        Self::new(&sample.u.map(f32::to_bits))
    }

    /// Two numbers in [0, 1).
    pub fn pair(&mut self) -> [f32; 2] {
        let bits = split_mix::next(&mut self.0);
        [bits >> 40, bits >> 8 & 0xff_ffff].map(|bits| bits as f32 * (1.0 / 16_777_216.0))
    }

    /// A number below `count`, which is much smaller than 2^32.
    pub fn below(&mut self, count: usize) -> usize {
        (((split_mix::next(&mut self.0) >> 32) * count as u64) >> 32) as usize
    }
}

/// The lights of a scene, for samplers that draw candidates.
pub struct LightList<'a> {
    /// Samples points on lights.
    pub sampler: LightSampler<'a>,
    pub ids: &'a [LightId],
    /// The lights in the world's space, in the order of `ids`.
    pub lights: &'a [Light],
    /// Draws lights in proportion to their flux.
    pub by_flux: Alias,
}

/// A point on a light that a list holds.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    pub point: LightPoint,
    /// The index of the light, and the numbers that choose the point on it.
    pub light: u32,
    pub u: [f32; 2],
    /// One over the probability of the light, or the unbiased estimate of that.
    pub weight: f32,
}

impl<'a> LightList<'a> {
    /// `lights` and `ids` as for [`crate::measuring::samplers::published`]. At least one light must
    /// have flux.
    pub fn new(sampler: LightSampler<'a>, ids: &'a [LightId], lights: &'a [Light]) -> Self {
        let flux: Vec<f64> = lights.iter().map(|light| f64::from(light.flux())).collect();
        Self { sampler, ids, lights, by_flux: Alias::new(&flux) }
    }

    /// A point on a light.
    pub fn candidate(&self, light: usize, u: [f32; 2], weight: f32) -> Candidate {
        Candidate { point: LightPoint::new(&self.lights[light], u), light: light as u32, u, weight }
    }

    /// The sample of a candidate that a reservoir kept. `weight` is the unbiased estimate of one over
    /// its probability.
    pub fn drawn(&self, surface: &Surface, kept: &Candidate, weight: f32) -> Option<Drawn> {
        let light = self.ids[kept.light as usize];
        let incident = self.sampler.sample_light(&surface.shading_point, light, kept.u)?;
        Some(Drawn { incident, weight: weight / incident.pdf, light: kept.light, id: light, numbers: kept.u })
    }
}

impl Candidate {
    /// An estimate of the light that a surface reflects from this point, not divided by a probability.
    pub fn target(&self, surface: &Surface, material: &Material) -> f32 {
        self.point.illuminance(&surface.shading_point).map_or(0.0, |(direction, lux)| {
            lux * luminance(brdf(material, surface.shading_point.normal, surface.toward_eye, direction))
        })
    }
}

/// Keeps one of the candidates of a stream, in proportion to their weights.
///
/// Source: Bitterli et al., Spatiotemporal Reservoir Resampling (2020), algorithm 2.
#[derive(Clone, Copy)]
pub struct Reservoir<T> {
    total: f32,
    /// What was kept, and its target.
    kept: Option<(T, f32)>,
}

impl<T: Copy> Reservoir<T> {
    pub fn new() -> Self {
        Self { total: 0.0, kept: None }
    }

    /// Offers an item: `target` is the density in proportion to which items are kept, without its
    /// constant factor, and `weight` one over the probability with which the item was drawn, times its
    /// share of the stream. `u` in [0, 1) decides.
    pub fn offer(&mut self, item: T, target: f32, weight: f32, u: f32) {
        let weight = target * weight;
        if weight > 0.0 {
            self.total += weight;
            if u * self.total < weight {
                self.kept = Some((item, target));
            }
        }
    }

    /// What was kept, and the unbiased estimate of one over its probability.
    pub fn kept(self) -> Option<(T, f32)> {
        self.kept.map(|(item, target)| (item, self.total / target))
    }
}

//! Ways to draw a point on a light for one sample.

use super::view::Surface;
use crate::common::split_mix;
use crate::measuring::samplers::Chooser;
use crate::render::shading::{brdf, gloss};
use crate::scene::Material;
use girandole::glam::Vec3;
use girandole::light::luminance;
use girandole::{Incident, LightId, LightSample, LightSampler, Reservoir, ShadingPoint};

/// A point on a light, and the factor that turns its light into an estimate of the light by all
/// lights.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    pub incident: Incident,
    /// One over the probability density of the point, or the unbiased estimate of it by a
    /// reservoir.
    pub weight: f32,
    /// The light's index, for samplers that read [`Found`]; 0 for others.
    pub light: u32,
    /// The light's name in the world.
    pub id: LightId,
    /// The numbers that choose the point on it.
    pub numbers: [f32; 2],
}

impl Drawn {
    /// The light of a reservoir of the library at a shading point.
    pub fn kept(lights: &LightSampler<'_>, at: &ShadingPoint, reservoir: &Reservoir) -> Option<Self> {
        let LightSample { light, incident, .. } = lights.reservoir_sample(at, reservoir)?;
        Some(Self {
            incident,
            weight: reservoir.weight / incident.pdf,
            light: 0,
            id: light,
            numbers: reservoir.numbers,
        })
    }

    /// The reservoir that keeps it, without what it reflects.
    pub fn reservoir(&self, lights: &LightSampler<'_>) -> Reservoir {
        Reservoir { weight: self.weight * self.incident.pdf, ..lights.reservoir_of(self.id, self.numbers) }
    }
}

/// A sample of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// The index of the pixel, row by row from the top.
    pub pixel: u32,
    /// The number of the frame that it belongs to. A frame has one sample per pixel.
    pub frame: u32,
    /// Uniform in [0, 1); the fifth chooses among candidates.
    pub u: [f32; 5],
}

/// What the sample of a pixel has found: a light, and the luminance of its estimate, with shadows.
#[derive(Clone, Copy, Debug, Default)]
pub struct Found {
    /// [`Drawn::light`].
    pub light: u32,
    /// Zero where no light arrives.
    pub luminance: f32,
}

/// A frame that is about to be drawn.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Seeds the random numbers of the picture that the frame belongs to.
    pub seed: u32,
    /// Rises by 1 from frame to frame. With 0, a sampler forgets all frames before.
    pub number: u32,
    /// What the samples of the frame before have found, for each pixel; empty for frame 0.
    pub found: &'a [Found],
}

/// A way to draw a point on a light.
pub trait Draw: Send + Sync {
    /// Draws a point for a surface. `None` where the draw ends without light: the sample is black.
    fn draw(&self, surface: &Surface, material: &Material, sample: &Sample) -> Option<Drawn>;

    /// Learns what the shadow ray of a draw has found. Called for each draw that has one.
    fn learn(&self, _: &Surface, _: &Sample, _: &Drawn, _is_visible: bool) {}

    /// Takes in what the frame before has taught, in a time that does not grow with the picture.
    fn fold(&mut self, _: &Frame<'_>) {}

    /// Prepares a frame. Called before its samples are drawn, and after [`Draw::fold`].
    fn prepare(&mut self, _: &Frame<'_>) {}

    /// The frames in which a sampler learns before its pictures begin.
    fn warm_up(&self) -> u32 {
        0
    }

    /// The samples that share what is prepared, in pictures of so many pixels.
    fn samples_per_preparation(&self, pixels: f64) -> f64 {
        pixels
    }

    /// The bytes of what is prepared.
    fn prepared_bytes(&self) -> usize {
        0
    }
}

/// What a sampler is told of a surface: how it reflects, if it can know that.
pub(super) fn told(surface: &Surface, material: &Material, has_gloss: bool) -> ShadingPoint {
    let at = surface.shading_point;
    if has_gloss { at.with_gloss(gloss(material, surface.toward_eye)) } else { at }
}

/// Chooses one light, then a point on it.
pub struct Single<'a> {
    pub chooser: &'a Chooser<'a>,
    pub lights: LightSampler<'a>,
    /// The chooser is told how surfaces reflect.
    pub has_gloss: bool,
}

impl Draw for Single<'_> {
    fn draw(&self, surface: &Surface, material: &Material, sample: &Sample) -> Option<Drawn> {
        let [a, b, x, y, _] = sample.u;
        let at = told(surface, material, self.has_gloss);
        let pick = self.chooser.choose(&at, [a, b])?;
        let incident = self.lights.sample_light(&at, pick.light, [x, y])?;
        let weight = 1.0 / (incident.pdf * pick.pmf);
        Some(Drawn { incident, weight, light: 0, id: pick.light, numbers: [x, y] })
    }
}

/// Draws several candidates from the light trees and keeps one.
pub struct Resampled<'a> {
    pub lights: LightSampler<'a>,
    pub candidates: u32,
    /// Candidates are chosen and weighed by the light that a glossy surface reflects.
    pub has_gloss: bool,
}

impl Draw for Resampled<'_> {
    fn draw(&self, surface: &Surface, material: &Material, sample: &Sample) -> Option<Drawn> {
        let at = told(surface, material, self.has_gloss);
        Drawn::kept(&self.lights, &at, &self.lights.resample(&at, sample.u, self.candidates))
    }
}

/// Draws several candidates from the light trees and keeps one in proportion to the light that it
/// reflects without shadows.
pub struct ResampledByBrdf<'a> {
    pub lights: LightSampler<'a>,
    pub candidates: u32,
}

impl Draw for ResampledByBrdf<'_> {
    fn draw(&self, surface: &Surface, material: &Material, sample: &Sample) -> Option<Drawn> {
        let at = &surface.shading_point;
        let [a, b, x, y, choice] = sample.u;
        let mut state = u64::from(choice.to_bits());
        let mut kept = Reservoir::default();
        for i in 0..self.candidates {
            let [a, b, x, y] = Reservoir::candidate_numbers([a, b, x, y], i, self.candidates);
            let mut own = self.lights.resample(at, [a, b, x, y, choice], 1);
            own.reflected = self.lights.reservoir_sample(at, &own).map_or(0.0, |light| {
                let unshadowed = luminance(reflected(surface, material, &light.incident)) / light.incident.pdf;
                unshadowed * self.lights.visible_share(at, &light)
            });
            let choice = (split_mix::next(&mut state) >> 40) as f32 * (1.0 / 16_777_216.0);
            kept = kept.merge(kept.reflected, &own, own.reflected, choice);
        }
        Drawn::kept(&self.lights, at, &kept)
    }
}

/// The integrand of direct light: BRDF times incident radiance times cosine, not yet divided by a
/// density. Zero from behind.
pub fn reflected(surface: &Surface, material: &Material, incident: &Incident) -> Vec3 {
    let normal = surface.shading_point.normal;
    let cosine = normal.dot(incident.direction);
    if cosine <= 0.0 {
        return Vec3::ZERO;
    }
    brdf(material, normal, surface.toward_eye, incident.direction) * incident.radiance * cosine
}

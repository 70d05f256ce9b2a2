//! Ways to draw a point on a light for one sample.

use super::view::Surface;
use crate::common::split_mix;
use crate::measuring::samplers::Chooser;
use crate::render::shading::{brdf, specular_reflectance};
use crate::scene::Material;
use girandole::glam::Vec3;
use girandole::light::luminance;
use girandole::{Gloss, Incident, LightId, LightSample, LightSampler, Reservoir, ShadingPoint};

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

/// Chooses one light, then a point on it.
pub struct Single<'a> {
    pub chooser: &'a dyn Chooser,
    pub lights: LightSampler<'a>,
}

impl Draw for Single<'_> {
    fn draw(&self, surface: &Surface, _: &Material, sample: &Sample) -> Option<Drawn> {
        let [a, b, x, y, _] = sample.u;
        let pick = self.chooser.choose(&surface.shading_point, [a, b])?;
        let incident = self.lights.sample_light(&surface.shading_point, pick.light, [x, y])?;
        let weight = 1.0 / (incident.pdf * pick.pmf);
        Some(Drawn { incident, weight, light: 0, id: pick.light, numbers: [x, y] })
    }
}

/// Does the same as [`Single`], for a chooser that is told how surfaces reflect.
pub struct SingleWithGloss<'a> {
    pub chooser: &'a dyn Chooser,
    pub lights: LightSampler<'a>,
}

impl Draw for SingleWithGloss<'_> {
    fn draw(&self, surface: &Surface, material: &Material, sample: &Sample) -> Option<Drawn> {
        let shading_point = surface.shading_point.with_gloss(gloss(surface, material));
        let single = Single { chooser: self.chooser, lights: self.lights };
        single.draw(&Surface { shading_point, ..*surface }, material, sample)
    }
}

/// Draws several candidates from the light trees and keeps one.
pub struct Resampled<'a> {
    pub lights: LightSampler<'a>,
    pub candidates: u32,
}

impl Draw for Resampled<'_> {
    fn draw(&self, surface: &Surface, _: &Material, sample: &Sample) -> Option<Drawn> {
        let at = &surface.shading_point;
        Drawn::kept(&self.lights, at, &self.lights.resample(at, sample.u, self.candidates))
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

/// Draws several candidates, which are chosen and weighed by the light that a glossy surface
/// reflects.
pub struct ResampledWithGloss<'a> {
    pub lights: LightSampler<'a>,
    pub candidates: u32,
}

impl Draw for ResampledWithGloss<'_> {
    fn draw(&self, surface: &Surface, material: &Material, sample: &Sample) -> Option<Drawn> {
        let at = surface.shading_point.with_gloss(gloss(surface, material));
        Drawn::kept(&self.lights, &at, &self.lights.resample(&at, sample.u, self.candidates))
    }
}

/// What the library is told of a surface.
pub(super) fn gloss(surface: &Surface, material: &Material) -> Gloss {
    let specular = luminance(specular_reflectance(material));
    let diffuse = luminance(material.base_color) * (1.0 - material.metallic);
    Gloss { view: surface.toward_eye, roughness: material.roughness, specular, diffuse }
}

/// Streams uniformly chosen lights through a reservoir and keeps one in proportion to the light
/// that it reflects without shadows.
///
/// Source: Bitterli et al., Spatiotemporal Reservoir Resampling (2020), algorithm 3, without reuse
/// between pixels or frames.
pub struct Streaming<'a> {
    pub lights: LightSampler<'a>,
    pub ids: &'a [LightId],
    pub candidates: u32,
}

impl Draw for Streaming<'_> {
    fn draw(&self, surface: &Surface, material: &Material, sample: &Sample) -> Option<Drawn> {
        let mut state = sample.u.iter().fold(0, |state, u| split_mix::mix(state ^ u64::from(u.to_bits())));
        let mut unit = || (split_mix::next(&mut state) >> 40) as f32 * (1.0 / 16_777_216.0);
        let (mut total, mut kept) = (0.0, None);
        for _ in 0..self.candidates {
            let light =
                self.ids[((f64::from(unit()) + f64::from(unit()) / 16_777_216.0) * self.ids.len() as f64) as usize];
            let point = [unit(), unit()];
            let keep = unit();
            let Some(incident) = self.lights.sample_light(&surface.shading_point, light, point) else { continue };
            let target = luminance(reflected(surface, material, &incident));
            if target > 0.0 {
                let weight = target * self.ids.len() as f32 / incident.pdf;
                total += weight;
                if keep * total < weight {
                    kept = Some((incident, target, light, point));
                }
            }
        }
        let (incident, target, id, numbers) = kept?;
        Some(Drawn { incident, weight: total / (self.candidates as f32 * target), light: 0, id, numbers })
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

//! Pictures by one drawn light per sample, and the time that each stage of a sample takes.

use super::draw::{Draw, reflected};
use super::numbers::numbers;
use super::shadows::Shadows;
use super::view::{Pixel, SUBPIXELS, Surface, View};
use crate::common::lattice::{Dimension, random};
use crate::render::geometry::Geometry;
use crate::scene::{Material, Scene};
use girandole::glam::Vec3;
use girandole::{Incident, LightId, LightSampler};
use rayon::prelude::*;
use std::time::{Duration, Instant};

/// Ways to draw take turns for this many rounds, and the fastest round of each stage counts:
/// moments in which the machine is busy do not.
const ROUNDS: usize = 15;
/// The random numbers of the rounds.
const TIMING_SEED: u32 = 3;

/// What all ways to draw share: the surfaces in view, their materials, and what casts shadows.
pub struct Renderer<'a> {
    pub scene: &'a Scene,
    pub geometry: &'a Geometry,
    pub view: &'a View,
}

/// The seconds that each stage of one sample takes on one thread, as means over the samples of a
/// picture.
#[derive(Clone, Copy, Debug)]
pub struct StageTimes {
    /// Drawing a light and a point on it.
    pub choosing: f64,
    /// Shadow rays, which only samples that reflect light need.
    pub shadow_rays: f64,
    /// The BRDF and the product of all factors.
    pub shading: f64,
}

impl StageTimes {
    const UNKNOWN: Self = Self { choosing: f64::INFINITY, shadow_rays: f64::INFINITY, shading: f64::INFINITY };

    /// All times multiplied by a factor.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            choosing: self.choosing * factor,
            shadow_rays: self.shadow_rays * factor,
            shading: self.shading * factor,
        }
    }

    /// The time of a whole sample.
    pub fn total(&self) -> f64 {
        self.choosing + self.shadow_rays + self.shading
    }
}

impl Renderer<'_> {
    /// Renders a picture, radiance in nits, row by row from the top.
    ///
    /// `samples` is the mean number of samples per pixel, at least 1. Each pixel takes the integer
    /// below or above it, with the probabilities that give this mean. Pixels of the sky take none.
    pub fn picture(&self, draw: &dyn Draw, samples: f64, seed: u32) -> Vec<Vec3> {
        let pixel = |(index, pixel): (usize, &Pixel)| {
            let [rounding, first, ..] = random(index as u32, 0, seed, Dimension::Pixel);
            let count = samples.floor() as u32 + u32::from(f64::from(rounding) < samples.fract());
            let first = (first * SUBPIXELS as f32) as usize;
            let sum: Vec3 = (0..count).map(|i| self.sample(draw, index, pixel, (i, first), seed)).sum();
            pixel.background + sum / count as f32
        };
        self.view.pixels.par_iter().enumerate().map(pixel).collect()
    }

    /// The radiance of one pixel by all lights, with one shadow ray to each light in each of
    /// `samples` samples.
    pub fn pixel_by_all(
        &self,
        lights: &LightSampler<'_>,
        ids: &[LightId],
        index: usize,
        (samples, seed): (u32, u32),
    ) -> Vec3 {
        let pixel = &self.view.pixels[index];
        let [_, first, ..] = random(index as u32, 0, seed, Dimension::Pixel);
        let first = (first * SUBPIXELS as f32) as usize;
        let sum: Vec3 = (0..samples)
            .filter_map(|sample| {
                let surface = pixel.surfaces[(sample as usize + first) % SUBPIXELS].as_ref()?;
                let [.., x, y] = random(index as u32, sample, seed, Dimension::Light);
                let one = |light: &LightId| {
                    let incident = lights.sample_light(&surface.shading_point, *light, [x, y])?;
                    let light = self.reflected(surface, &incident) / incident.pdf;
                    (light.max_element() > 0.0 && !self.is_shadowed(surface, &incident)).then_some(light)
                };
                Some(ids.iter().filter_map(one).sum::<Vec3>())
            })
            .sum();
        pixel.background + sum / samples as f32
    }

    /// Measures the time of each stage for each way to draw, at one sample of about `count` pixels
    /// that are spread over the picture.
    pub fn stage_times(&self, draws: &[&dyn Draw], count: usize) -> Vec<StageTimes> {
        let is_full = |(_, pixel): &(usize, &Pixel)| pixel.surfaces.iter().all(Option::is_some);
        let full: Vec<(usize, &Pixel)> = self.view.pixels.iter().enumerate().filter(is_full).collect();
        let step = (full.len() / count.max(1)).max(1);
        let timed: Vec<(usize, &Surface)> = full
            .iter()
            .step_by(step)
            .filter_map(|(index, pixel)| Some((*index, pixel.surfaces[index % SUBPIXELS].as_ref()?)))
            .collect();
        let mut fastest = vec![StageTimes::UNKNOWN; draws.len()];
        let per_sample = |time: Duration| time.as_secs_f64() / timed.len().max(1) as f64;
        let (mut drawn, mut lit) = (Vec::with_capacity(timed.len()), Vec::with_capacity(timed.len()));
        for round in 0..ROUNDS {
            for (draw, fastest) in draws.iter().zip(&mut fastest) {
                drawn.clear();
                lit.clear();
                let start = Instant::now();
                for (index, surface) in &timed {
                    let u = numbers(*index as u32, round as u32, TIMING_SEED);
                    drawn.push(draw.draw(surface, self.material(surface), u));
                }
                let chosen = Instant::now();
                for ((_, surface), drawn) in timed.iter().zip(&drawn) {
                    let light = drawn.as_ref().map(|drawn| self.reflected(surface, &drawn.incident) * drawn.weight);
                    lit.push(light.unwrap_or_default());
                }
                let shaded = Instant::now();
                let mut unshadowed = 0;
                for (((_, surface), drawn), light) in timed.iter().zip(&drawn).zip(&lit) {
                    if let Some(drawn) = drawn.as_ref().filter(|_| light.max_element() > 0.0) {
                        unshadowed += u32::from(!self.is_shadowed(surface, &drawn.incident));
                    }
                }
                std::hint::black_box(unshadowed);
                fastest.choosing = fastest.choosing.min(per_sample(chosen - start));
                fastest.shading = fastest.shading.min(per_sample(shaded - chosen));
                fastest.shadow_rays = fastest.shadow_rays.min(per_sample(shaded.elapsed()));
            }
        }
        fastest
    }

    /// The light of one sample of a pixel. Samples visit the subpixels in turn, from the one
    /// numbered `first`.
    fn sample(&self, draw: &dyn Draw, index: usize, pixel: &Pixel, (sample, first): (u32, usize), seed: u32) -> Vec3 {
        let Some(surface) = &pixel.surfaces[(sample as usize + first) % SUBPIXELS] else { return Vec3::ZERO };
        let u = numbers(index as u32, sample, seed);
        let Some(drawn) = draw.draw(surface, self.material(surface), u) else { return Vec3::ZERO };
        let light = self.reflected(surface, &drawn.incident) * drawn.weight;
        if light.max_element() <= 0.0 || self.is_shadowed(surface, &drawn.incident) { Vec3::ZERO } else { light }
    }

    /// The material of a surface.
    pub fn material(&self, surface: &Surface) -> &Material {
        &self.scene.materials[surface.material as usize]
    }

    fn reflected(&self, surface: &Surface, incident: &Incident) -> Vec3 {
        reflected(surface, self.material(surface), incident)
    }

    /// Whether something opaque lies between a surface and a point on a light.
    pub fn is_shadowed(&self, surface: &Surface, incident: &Incident) -> bool {
        Shadows::new(self.scene, self.geometry).is_shadowed(&surface.shading_point, incident)
    }
}

//! Pictures by one light per sample, and the time that a sample takes.

use super::city::render::geometry::Geometry;
use super::city::render::shading::{Dimension, brdf, random};
use super::city::scene::Scene;
use super::samplers::Chooser;
use super::view::{Pixel, SUBPIXELS, Surface, View};
use girandole::glam::Vec3;
use girandole::{LightSampler, ShadingPoint};
use rayon::prelude::*;
use std::hint::black_box;
use std::time::Instant;

/// Shadow rays towards area lights end just before the surface of the light, which would shadow
/// itself.
const STOP_BEFORE_LIGHT: f32 = 1.0 - 1.0e-3;
/// Samplers take turns for this many rounds, and the fastest round counts: moments in which the
/// machine is busy do not.
const ROUNDS: usize = 15;
/// A round samples each pixel of every n-th row once.
const ROW_STEP: usize = 8;
/// The random numbers of the rounds.
const TIMING_SEED: u32 = 3;

/// What all samplers share: the surfaces in view, their materials, and what casts shadows.
pub struct Renderer<'a> {
    pub scene: &'a Scene,
    pub geometry: &'a Geometry,
    pub view: &'a View,
    /// Finds the point on a chosen light and its radiance.
    pub lights: LightSampler<'a>,
}

impl Renderer<'_> {
    /// Renders a picture, radiance in nits, row by row from the top.
    ///
    /// `samples` is the mean number of samples per pixel, at least 1. Each pixel takes the integer
    /// below or above it, with the probabilities that give this mean. Pixels of the sky take none.
    pub fn picture(&self, chooser: &dyn Chooser, samples: f64, seed: u32) -> Vec<Vec3> {
        let pixel = |(index, pixel): (usize, &Pixel)| {
            let [rounding, first, ..] = random(index as u32, 0, seed, Dimension::Pixel);
            let count = samples.floor() as u32 + u32::from(f64::from(rounding) < samples.fract());
            let first = (first * SUBPIXELS as f32) as usize;
            let sum: Vec3 = (0..count).map(|i| self.sample(chooser, index, pixel, (i, first), seed)).sum();
            pixel.background + sum / count as f32
        };
        self.view.pixels.par_iter().enumerate().map(pixel).collect()
    }

    /// Measures the seconds per sample of each sampler, on one thread: choosing, shading and shadow
    /// rays.
    pub fn seconds_per_sample<const N: usize>(&self, choosers: &[Box<dyn Chooser + '_>; N]) -> [f64; N] {
        let width = self.view.width;
        let rows = || self.view.pixels.chunks(width).enumerate().skip(ROW_STEP / 2).step_by(ROW_STEP);
        let timed: Vec<(usize, &Pixel)> = rows()
            .flat_map(|(y, row)| row.iter().enumerate().map(move |(x, pixel)| (y * width + x, pixel)))
            .filter(|(_, pixel)| pixel.surfaces.iter().all(Option::is_some))
            .collect();
        let mut fastest = [f64::INFINITY; N];
        for round in 0..ROUNDS {
            for (chooser, fastest) in choosers.iter().zip(&mut fastest) {
                let start = Instant::now();
                for (index, pixel) in &timed {
                    black_box(self.sample(chooser.as_ref(), *index, pixel, (round as u32, 0), TIMING_SEED));
                }
                *fastest = fastest.min(start.elapsed().as_secs_f64() / timed.len().max(1) as f64);
            }
        }
        fastest
    }

    /// The light of one sample of a pixel. Samples visit the subpixels in turn, from the one
    /// numbered `first`.
    fn sample(
        &self,
        chooser: &dyn Chooser,
        index: usize,
        pixel: &Pixel,
        (sample, first): (u32, usize),
        seed: u32,
    ) -> Vec3 {
        match &pixel.surfaces[(sample as usize + first) % SUBPIXELS] {
            Some(surface) => self.light(chooser, surface, random(index as u32, sample, seed, Dimension::Light)),
            None => Vec3::ZERO,
        }
    }

    /// Radiance towards the camera by one chosen light, over the probability of the choice.
    fn light(&self, chooser: &dyn Chooser, surface: &Surface, [u, v, x, y]: [f32; 4]) -> Vec3 {
        let ShadingPoint { position, normal, .. } = surface.shading_point;
        let Some(pick) = chooser.choose(&surface.shading_point, [u, v]) else { return Vec3::ZERO };
        let incident = self.lights.sample_light(&surface.shading_point, pick.light, [x, y]);
        let Some(incident) = incident else { return Vec3::ZERO };
        let cosine = normal.dot(incident.direction);
        if cosine <= 0.0 {
            return Vec3::ZERO;
        }
        let material = &self.scene.materials[surface.material as usize];
        let reflected = brdf(material, normal, surface.toward_eye, incident.direction) * incident.radiance;
        let limit = match incident.is_delta {
            true => incident.dist - self.scene.lamp_clearance,
            false => incident.dist * STOP_BEFORE_LIGHT,
        };
        if self.geometry.occluders.may_block(position, incident.direction, limit)
            && self.geometry.occluded(position, incident.direction, limit)
        {
            return Vec3::ZERO;
        }
        reflected * (cosine / (incident.pdf * pick.pmf))
    }
}

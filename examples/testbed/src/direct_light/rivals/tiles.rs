//! Presampled lists of points on lights, of which blocks of pixels share one and each sample resamples
//! a few.
//!
//! Source: Wyman and Panteleev, Rearchitecting Spatiotemporal Resampling for Production (2021), as
//! `bevy_solari` of Bevy 0.17 uses it: 128 lists of 1,024 points, renewed in every frame, one list for
//! a block of 8 x 8 pixels, 8 candidates (32 in its first version) by the light that arrives without
//! shadows. Differs: points are drawn by flux, where `bevy_solari` draws all lights alike, and the
//! target has the whole BRDF, where it has the diffuse part. Reuse between pixels and frames is left
//! out, as for all samplers here.

use super::candidates::{Candidate, FULL_HD, LightList, Random, Reservoir};
use crate::direct_light::draw::{Draw, Drawn, Frame, Sample};
use crate::direct_light::view::Surface;
use crate::scene::Material;
use rayon::prelude::*;

const LISTS: usize = 128;
const POINTS: usize = 1_024;
/// Pixels along each side of a block.
const BLOCK: u32 = 8;

/// Draws from lists that are the same for a block of pixels.
pub struct Presampled<'a> {
    lights: LightList<'a>,
    /// Pixels of a row of the picture.
    width: u32,
    candidates: u32,
    /// All lists.
    points: Vec<Candidate>,
}

impl<'a> Presampled<'a> {
    pub fn new(lights: LightList<'a>, width: u32, candidates: u32) -> Self {
        Self { lights, width, candidates, points: Vec::new() }
    }
}

impl Draw for Presampled<'_> {
    fn prepare(&mut self, frame: &Frame<'_>) {
        let Self { lights, points, .. } = self;
        let point = |index: usize| {
            let mut random = Random::new(&[frame.seed, frame.number, index as u32]);
            let light = lights.by_flux.draw(random.pair());
            lights.candidate(light, random.pair(), 1.0 / lights.by_flux.probability(light))
        };
        (0..LISTS * POINTS).into_par_iter().map(point).collect_into_vec(points);
    }

    fn draw(&self, surface: &Surface, material: &Material, sample: &Sample) -> Option<Drawn> {
        let block = [sample.pixel % self.width / BLOCK, sample.pixel / self.width / BLOCK];
        let list = Random::new(&[block[0], block[1], sample.frame]).below(LISTS) * POINTS;
        let mut random = Random::of_sample(sample);
        let mut reservoir = Reservoir::new();
        for _ in 0..self.candidates {
            let point = &self.points[list + random.below(POINTS)];
            reservoir.offer(point, point.target(surface, material), point.weight, random.pair()[0]);
        }
        let (kept, weight) = reservoir.kept()?;
        self.lights.drawn(surface, kept, weight / self.candidates as f32)
    }

    /// The lists do not grow with the picture.
    fn samples_per_preparation(&self, pixels: f64) -> f64 {
        pixels.max(FULL_HD)
    }

    fn prepared_bytes(&self) -> usize {
        LISTS * POINTS * size_of::<Candidate>()
    }
}

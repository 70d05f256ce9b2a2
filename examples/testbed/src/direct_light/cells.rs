//! The library with cuts that neighbours share.

use super::draw::{Draw, Drawn, Frame, Sample, gloss};
use super::view::{Surface, View};
use crate::scene::{Material, Scene};
use girandole::{CandidateCount, CutBuild, CutOptions, CutTable, LightWorld, ShadingPoint};
use rayon::prelude::*;

/// The frames for which cuts stay, since nothing moves.
const FRAMES: u32 = 16;
/// The edges of cells in pixels of the picture, over those of the library. A cell then has as many samples
/// in these frames as one of the library's in one frame.
const EDGE: f32 = 0.25;

/// Draws several candidates from the cuts of cells and keeps one.
pub struct SharedCells<'a> {
    world: &'a LightWorld,
    view: &'a View,
    scene: &'a Scene,
    has_gloss: bool,
    candidates: CandidateCount,
    cuts: CutTable,
}

impl<'a> SharedCells<'a> {
    /// With `has_gloss`, the library is told how surfaces reflect.
    pub fn new(
        world: &'a LightWorld,
        (view, scene): (&'a View, &'a Scene),
        (has_gloss, candidates): (bool, CandidateCount),
    ) -> Self {
        let mut cuts = CutTable::new(CutOptions::default());
        let height = (view.pixels.len() / view.width) as f32;
        let pixel = 2.0 * (0.5 * scene.camera.vertical_fov).tan() / height;
        cuts.set_view(scene.camera.eye.as_dvec3() + world.origin(), EDGE * pixel);
        Self { world, view, scene, has_gloss, candidates, cuts }
    }

    fn shading_point(&self, surface: &Surface, material: &Material) -> ShadingPoint {
        match self.has_gloss {
            true => surface.shading_point.with_gloss(gloss(surface, material)),
            false => surface.shading_point,
        }
    }
}

impl Draw for SharedCells<'_> {
    fn prepare(&mut self, frame: &Frame<'_>) {
        if !frame.number.is_multiple_of(FRAMES) {
            return;
        }
        // Nothing moves, so the table would keep the cuts of the picture before.
        self.cuts.clear();
        let sampler = self.world.sampler().with_cuts(&self.cuts);
        self.view.pixels.par_iter().flat_map_iter(|pixel| pixel.surfaces.iter().flatten()).for_each(|surface| {
            sampler.mark(&self.shading_point(surface, &self.scene.materials[surface.material as usize]));
        });
        let builds: Vec<CutBuild<'_>> = self.cuts.builds(self.world.sampler()).collect();
        builds.into_par_iter().for_each(CutBuild::run);
    }

    fn draw(&self, surface: &Surface, material: &Material, sample: &Sample) -> Option<Drawn> {
        let at = self.shading_point(surface, material);
        let lights = self.world.sampler().with_cuts(&self.cuts);
        let reservoir = lights.resample(&at, sample.u, self.candidates)?;
        Some(Drawn { incident: reservoir.chosen.incident, weight: reservoir.weight, light: 0 })
    }

    fn samples_per_preparation(&self, pixels: f64) -> f64 {
        pixels * f64::from(FRAMES)
    }

    fn prepared_bytes(&self) -> usize {
        self.cuts.memory_bytes()
    }
}

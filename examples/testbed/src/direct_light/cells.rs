//! The library with cuts that neighbours share, and with learnt visibility.

use super::draw::{Draw, Drawn, Frame, Sample, gloss};
use super::view::{Surface, View};
use crate::common::hash::pcg4d;
use crate::scene::{Material, Scene};
use girandole::{
    CandidateCount, CutBuild, CutOptions, CutTable, LightSample, LightSampler, LightWorld, ShadingPoint,
    VisibilityError, VisibilityOptions, VisibilityTable,
};
use rayon::prelude::*;

/// The frames for which cuts stay, since nothing moves.
const FRAMES: u32 = 16;
/// The edges of cells in pixels of the picture, over those of the library. A cell then has as many samples
/// in these frames as one of the library's in one frame.
const EDGE: f32 = 0.25;
/// The edge of the cells in which visibility is learnt, in metres, and their number.
const LEARNT: (f32, usize) = (1.0, 16_384);
/// The bytes of such a cell: see [`VisibilityOptions::new`].
const LEARNT_BYTES: usize = 7_500;
/// The frames that teach before a picture begins, and record each sample. The 590,000 records in a picture of 128 x 72
/// pixels are those of five frames of 1920 x 1080 that record one in [`RECORDED`].
pub const TAUGHT: u32 = 64;
/// One of so many samples of a picture is recorded, as in an engine with dense frames.
const RECORDED: u32 = 16;

/// What a sampler of shared cuts does besides.
#[derive(Clone, Copy, Debug)]
pub struct CellSettings {
    /// The library is told how surfaces reflect.
    pub has_gloss: bool,
    pub candidates: CandidateCount,
    /// The frames that teach before a picture begins; `None` without learnt visibility.
    pub taught: Option<u32>,
}

/// Draws several candidates from the cuts of cells and keeps one.
pub struct SharedCells<'a> {
    world: &'a LightWorld,
    view: &'a View,
    scene: &'a Scene,
    settings: CellSettings,
    cuts: CutTable,
    learnt: Option<VisibilityTable>,
}

impl<'a> SharedCells<'a> {
    /// Cells of a view that know nothing yet.
    pub fn new(
        world: &'a LightWorld,
        (view, scene): (&'a View, &'a Scene),
        settings: CellSettings,
    ) -> Result<Self, VisibilityError> {
        let mut cuts = CutTable::new(CutOptions::default());
        let height = (view.pixels.len() / view.width) as f32;
        let pixel = 2.0 * (0.5 * scene.camera.vertical_fov).tan() / height;
        cuts.set_view(scene.camera.eye.as_dvec3() + world.origin(), EDGE * pixel);
        let options = settings.taught.map(|_| VisibilityOptions::new(LEARNT.0, LEARNT.1)).transpose()?;
        Ok(Self { world, view, scene, settings, cuts, learnt: options.map(VisibilityTable::new) })
    }

    /// Whether cells are built in a frame.
    fn is_built_in(&self, frame: &Frame<'_>) -> bool {
        frame.number == self.warm_up() || frame.number.is_multiple_of(FRAMES)
    }

    fn shading_point(&self, surface: &Surface, material: &Material) -> ShadingPoint {
        match self.settings.has_gloss {
            true => surface.shading_point.with_gloss(gloss(surface, material)),
            false => surface.shading_point,
        }
    }
}

/// A sampler that knows what is learnt.
fn taught<'a>(world: &'a LightWorld, learnt: Option<&'a VisibilityTable>) -> LightSampler<'a> {
    let lights = world.sampler();
    learnt.map_or(lights, |table| lights.with_visibility(table))
}

impl Draw for SharedCells<'_> {
    fn fold(&mut self, frame: &Frame<'_>) {
        let is_folded = frame.number < self.warm_up() || self.is_built_in(frame);
        match &mut self.learnt {
            Some(table) if frame.number == 0 => table.clear(),
            Some(table) if is_folded => table.end_frame(),
            _ => {}
        }
    }

    fn prepare(&mut self, frame: &Frame<'_>) {
        if !self.is_built_in(frame) {
            return;
        }
        // Nothing moves, so the table would keep the cuts of the picture before.
        self.cuts.clear();
        let sampler = self.world.sampler().with_cuts(&self.cuts);
        self.view.pixels.par_iter().flat_map_iter(|pixel| pixel.surfaces.iter().flatten()).for_each(|surface| {
            sampler.mark(&self.shading_point(surface, &self.scene.materials[surface.material as usize]));
        });
        let builds: Vec<CutBuild<'_>> = self.cuts.builds(taught(self.world, self.learnt.as_ref())).collect();
        builds.into_par_iter().for_each(CutBuild::run);
    }

    fn draw(&self, surface: &Surface, material: &Material, sample: &Sample) -> Option<Drawn> {
        let at = self.shading_point(surface, material);
        let lights = taught(self.world, self.learnt.as_ref()).with_cuts(&self.cuts);
        lights.reservoir_sample(&at, &lights.resample(&at, sample.u, self.settings.candidates)).map(Into::into)
    }

    fn learn(&self, surface: &Surface, sample: &Sample, drawn: &Drawn, is_visible: bool) {
        let is_recorded = || {
            let [hash, ..] = pcg4d([sample.pixel, sample.frame, 0, 0]);
            sample.frame < self.warm_up() || hash.is_multiple_of(RECORDED)
        };
        if let (Some(table), Some(light)) = (&self.learnt, drawn.id.filter(|_| is_recorded())) {
            let lights = self.world.sampler().with_visibility(table);
            let drawn = LightSample { light, pmf: 1.0, incident: drawn.incident, user_data: 0 };
            lights.record_visibility(&surface.shading_point, &drawn, is_visible);
        }
    }

    fn warm_up(&self) -> u32 {
        self.settings.taught.unwrap_or(0)
    }

    fn samples_per_preparation(&self, pixels: f64) -> f64 {
        pixels * f64::from(FRAMES)
    }

    fn prepared_bytes(&self) -> usize {
        self.cuts.memory_bytes() + self.learnt.as_ref().map_or(0, |table| table.options().cells() * LEARNT_BYTES)
    }
}

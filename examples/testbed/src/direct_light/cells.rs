//! The library with cuts that neighbours share, and with learnt visibility.

use super::draw::{Draw, Drawn, Frame, Sample, told};
use super::view::{Surface, View};
use crate::common::hash::pcg4d;
use crate::scene::{Camera, Material, Scene};
use girandole::{
    CutOptions, CutTable, LightSample, LightSampler, LightWorld, ShadingPoint, ValueError, VisibilityOptions,
    VisibilityTable,
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
    pub candidates: u32,
    /// The frames that teach before a picture begins; `None` without learnt visibility.
    pub taught: Option<u32>,
}

/// Cells with cuts, and what is learnt.
pub struct Cells {
    settings: CellSettings,
    cuts: CutTable,
    learnt: Option<VisibilityTable>,
}

impl Cells {
    /// Cells that know nothing yet.
    pub fn new(settings: CellSettings) -> Result<Self, ValueError> {
        let options = settings.taught.map(|_| VisibilityOptions::new(LEARNT.0, LEARNT.1)).transpose()?;
        Ok(Self { settings, cuts: CutTable::new(CutOptions::default()), learnt: options.map(VisibilityTable::new) })
    }

    /// Sizes the cells for a picture of so many rows, or as if a pixel was `edge` times as wide.
    pub fn set_view(&mut self, world: &LightWorld, camera: &Camera, rows: f32, edge: f32) {
        let pixel = 2.0 * (0.5 * camera.vertical_fov).tan() / rows;
        self.cuts.set_view(camera.eye.as_dvec3() + world.origin(), edge * pixel);
    }

    /// Takes in what shadow rays have taught.
    pub fn end_frame(&mut self) {
        if let Some(table) = &mut self.learnt {
            table.end_frame();
        }
    }

    /// Builds the cuts of the cells that were marked.
    pub fn build(&mut self, world: &LightWorld) {
        self.cuts.build(taught(world, self.learnt.as_ref()));
    }

    /// Draws in a world. Each draw marks its cell.
    pub fn draws<'a>(&'a self, world: &'a LightWorld) -> CellDraws<'a> {
        CellDraws { cells: self, lights: taught(world, self.learnt.as_ref()).with_cuts(&self.cuts) }
    }

    fn draw(&self, lights: &LightSampler<'_>, at: &ShadingPoint, sample: &Sample) -> Option<Drawn> {
        Drawn::kept(lights, at, &lights.resample(at, sample.u, self.settings.candidates))
    }

    /// Records one of [`RECORDED`] shadow rays, or each.
    fn record(
        &self,
        world: LightSampler<'_>,
        surface: &Surface,
        sample: &Sample,
        drawn: &Drawn,
        (is_visible, all): (bool, bool),
    ) {
        let [hash, ..] = pcg4d([sample.pixel, sample.frame, 0, 0]);
        if let Some(table) = self.learnt.as_ref().filter(|_| all || hash.is_multiple_of(RECORDED)) {
            let drawn = LightSample { light: drawn.id, pmf: 1.0, incident: drawn.incident, user_data: 0 };
            world.with_visibility(table).record_visibility(&surface.shading_point, &drawn, is_visible);
        }
    }
}

/// A sampler that knows what is learnt.
fn taught<'a>(world: &'a LightWorld, learnt: Option<&'a VisibilityTable>) -> LightSampler<'a> {
    let lights = world.sampler();
    learnt.map_or(lights, |table| lights.with_visibility(table))
}

/// Draws several candidates from the cuts of cells and keeps one.
pub struct CellDraws<'a> {
    cells: &'a Cells,
    lights: LightSampler<'a>,
}

impl Draw for CellDraws<'_> {
    fn draw(&self, surface: &Surface, material: &Material, sample: &Sample) -> Option<Drawn> {
        let at = told(surface, material, self.cells.settings.has_gloss);
        self.lights.mark(&at);
        self.cells.draw(&self.lights, &at, sample)
    }

    fn learn(&self, surface: &Surface, sample: &Sample, drawn: &Drawn, is_visible: bool) {
        self.cells.record(self.lights, surface, sample, drawn, (is_visible, false));
    }
}

/// The same for a picture in which nothing moves: cells are built from all of its surfaces.
pub struct SharedCells<'a> {
    world: &'a LightWorld,
    view: &'a View,
    scene: &'a Scene,
    cells: Cells,
}

impl<'a> SharedCells<'a> {
    /// Cells of a view that know nothing yet.
    pub fn new(
        world: &'a LightWorld,
        (view, scene): (&'a View, &'a Scene),
        settings: CellSettings,
    ) -> Result<Self, ValueError> {
        let mut cells = Cells::new(settings)?;
        cells.set_view(world, &scene.camera, (view.pixels.len() / view.width) as f32, EDGE);
        Ok(Self { world, view, scene, cells })
    }

    /// Whether cells are built in a frame.
    fn is_built_in(&self, frame: &Frame<'_>) -> bool {
        frame.number == self.warm_up() || frame.number.is_multiple_of(FRAMES)
    }
}

impl Draw for SharedCells<'_> {
    fn fold(&mut self, frame: &Frame<'_>) {
        let is_folded = frame.number < self.warm_up() || self.is_built_in(frame);
        match &mut self.cells.learnt {
            Some(table) if frame.number == 0 => table.clear(),
            Some(_) if is_folded => self.cells.end_frame(),
            _ => {}
        }
    }

    fn prepare(&mut self, frame: &Frame<'_>) {
        if !self.is_built_in(frame) {
            return;
        }
        // Nothing moves, so the table would keep the cuts of the picture before.
        self.cells.cuts.clear();
        let sampler = self.world.sampler().with_cuts(&self.cells.cuts);
        self.view.pixels.par_iter().flat_map_iter(|pixel| pixel.surfaces.iter().flatten()).for_each(|surface| {
            let material = &self.scene.materials[surface.material as usize];
            sampler.mark(&told(surface, material, self.cells.settings.has_gloss));
        });
        self.cells.build(self.world);
    }

    fn draw(&self, surface: &Surface, material: &Material, sample: &Sample) -> Option<Drawn> {
        let at = told(surface, material, self.cells.settings.has_gloss);
        let lights = taught(self.world, self.cells.learnt.as_ref()).with_cuts(&self.cells.cuts);
        self.cells.draw(&lights, &at, sample)
    }

    fn learn(&self, surface: &Surface, sample: &Sample, drawn: &Drawn, is_visible: bool) {
        let all = sample.frame < self.warm_up();
        self.cells.record(self.world.sampler(), surface, sample, drawn, (is_visible, all));
    }

    fn warm_up(&self) -> u32 {
        self.cells.settings.taught.unwrap_or(0)
    }

    fn samples_per_preparation(&self, pixels: f64) -> f64 {
        pixels * f64::from(FRAMES)
    }

    fn prepared_bytes(&self) -> usize {
        let Cells { cuts, learnt, .. } = &self.cells;
        cuts.memory_bytes() + learnt.as_ref().map_or(0, |_| LEARNT.1 * LEARNT_BYTES)
    }
}

//! Learnt visibility: the table that earlier frames of the same view taught, and draws that follow
//! it.

use super::settings::KNOB_SAMPLES;
use girandole::{CandidateCount, LightSampler, VisibilityOptions, VisibilityTable};
use rayon::prelude::*;
use std::time::{Duration, Instant};
use testbed::direct_light::draw::{Draw, Drawn, Sample};
use testbed::direct_light::numbers::numbers;
use testbed::direct_light::renderer::Renderer;
use testbed::direct_light::view::Surface;
use testbed::scene::{Material, SceneError};

/// The edge of a cell in metres, and the number of cells: those of the street in docs/benchmarks.md.
const CELLS: (f32, usize) = (1.0, 16_384);
/// The bytes of a cell: see [`VisibilityOptions::new`].
const CELL_BYTES: usize = 7_500;
/// Seeds the samples of frames that teach, between those of pictures and of references.
const SEED: u32 = 500_000;

/// A table that frames taught.
pub struct Learnt {
    pub table: VisibilityTable,
    /// The mean time of the end of a frame on one thread, in milliseconds.
    pub end_ms: f64,
}

impl Learnt {
    /// Renders `frames` with [`KNOB_SAMPLES`] per pixel and records each shadow ray. Each frame
    /// draws by what those before it taught, as in an engine.
    pub fn new(
        renderer: &Renderer<'_>,
        lights: LightSampler<'_>,
        candidates: CandidateCount,
        frames: u32,
    ) -> Result<Self, SceneError> {
        let options = VisibilityOptions::new(CELLS.0, CELLS.1).map_err(|error| SceneError(error.to_string()))?;
        let mut table = VisibilityTable::new(options);
        let mut ends = Duration::ZERO;
        for frame in 0..frames {
            let lights = lights.with_visibility(&table);
            renderer.view.pixels.par_iter().enumerate().for_each(|(index, pixel)| {
                for sample in 0..KNOB_SAMPLES as u32 {
                    let Some(surface) = pixel.surfaces[sample as usize % pixel.surfaces.len()] else { continue };
                    let u = numbers(index as u32, sample, SEED + frame);
                    let Some(kept) = lights.resample(&surface.shading_point, u, candidates) else { continue };
                    let is_visible = !renderer.is_shadowed(&surface, &kept.chosen.incident);
                    lights.record_visibility(&surface.shading_point, kept.chosen.light, is_visible);
                }
            });
            let start = Instant::now();
            table.end_frame();
            ends += start.elapsed();
        }
        Ok(Self { table, end_ms: ends.as_secs_f64() * 1.0e3 / f64::from(frames.max(1)) })
    }

    /// The bytes of the table.
    pub fn memory_bytes(&self) -> usize {
        self.table.options().cells() * CELL_BYTES
    }
}

/// Draws candidates by learnt visibility and keeps one.
///
/// A frame that learns also records the result of each shadow ray. A draw records before the ray is
/// traced, only so that its time is part of the draw: records change nothing until the end of a
/// frame, which never comes here.
pub struct ByVisibility<'a> {
    /// With the table.
    pub lights: LightSampler<'a>,
    pub candidates: CandidateCount,
}

impl Draw for ByVisibility<'_> {
    fn draw(&self, surface: &Surface, _: &Material, sample: &Sample) -> Option<Drawn> {
        let reservoir = self.lights.resample(&surface.shading_point, sample.u, self.candidates)?;
        self.lights.record_visibility(&surface.shading_point, reservoir.chosen.light, true);
        Some(Drawn { incident: reservoir.chosen.incident, weight: reservoir.weight, light: 0 })
    }
}

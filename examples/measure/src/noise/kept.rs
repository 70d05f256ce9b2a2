//! Cuts of cells that are kept while the city's traffic drives: their noise beside that of cuts that were just built.

use super::effort::Effort;
use super::shading_points::shading_points;
use super::stages::CITY_BOUNDS;
use girandole::{CutOptions, CutTable, FrameBudget, ShadingPoint};
use rayon::prelude::*;
use std::path::Path;
use testbed::common::table::{Table, markdown_head, short};
use testbed::measuring::lights::{carried, illuminances};
use testbed::measuring::{samplers, shared_cuts};
use testbed::scene::procedural::{self, CityOptions, Size};
use testbed::scene::{SceneError, Stage};

const COLUMNS: [&str; 6] = ["frame", "kept_mean", "kept_p999", "new_mean", "new_p999", "built"];

/// The edge of cells, in metres.
const EDGE: f32 = 0.5;

/// The frames after which noise is measured; there are 60 a second.
const FRAMES: [usize; 7] = [0, 1, 6, 15, 30, 60, 120];

/// Measures a city, and writes the table.
pub fn run(size: Size, count: usize, effort: Effort, out: &Path) -> Result<(), SceneError> {
    let refused = |error: girandole::ValueError| SceneError(error.to_string());
    let mut stage = procedural::stage(&CityOptions { size, cars: None, seed: 1, lamp_profile: None })?;
    stage.remove_directionals()?;
    let points = shading_points(&stage.scene, &CITY_BOUNDS, count)?;
    let mut cuts = CutTable::new(CutOptions::new(EDGE, (16 * count).clamp(1, 1 << 16)).map_err(refused)?);
    let mut table = Table::create(out, &COLUMNS).map_err(SceneError)?;
    testbed::say!("{}", markdown_head(&COLUMNS));
    let mut frame = 0;
    let Stage { scene, world, animation } = &mut stage;
    for last in FRAMES.into_iter().take(effort.select(FRAMES.len(), 3)) {
        let (first, mut built) = (frame, 0.0);
        while frame <= last {
            animation.advance(1.0 + frame as f64 / 60.0, scene, world)?;
            world.update(FrameBudget::NONE);
            shared_cuts::mark(world, &cuts, &points, EDGE);
            cuts.build(world.sampler());
            built += cuts.report().built as f64 / (cuts.report().built + cuts.report().kept).max(1) as f64;
            frame += 1;
        }
        let new = shared_cuts::table(world, &points, EDGE).map_err(refused)?;
        let lights = carried(world);
        let lux: Vec<Vec<f32>> = points.par_iter().map(|at: &ShadingPoint| illuminances(&lights, at)).collect();
        let [kept, new] = [&cuts, &new].map(|cuts| {
            let chooser = samplers::shared("cells", world, cuts);
            samplers::noise(&chooser, &points, &lux).0
        });
        let cells = [kept.mean, kept.p999, new.mean, new.p999, built / (frame - first).max(1) as f64].map(short);
        let row: Vec<String> = [last.to_string()].into_iter().chain(cells).collect();
        testbed::say!("| {} |", row.join(" | "));
        table.add(&row).map_err(SceneError)?;
    }
    Ok(())
}

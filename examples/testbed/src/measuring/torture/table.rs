//! What each sampler achieves on a scene of the set.

use super::TortureScene;
use crate::measuring::lights::{carried, reflections};
use crate::measuring::samplers::{self, Chooser};
use crate::measuring::shared_cuts;
use crate::measuring::sigma::Summary;
use crate::scene::SceneError;
use girandole::{CutTable, Light, LightId, WorldError};
use rayon::prelude::*;

/// The noise of one sampler on one scene.
pub struct TortureRow {
    pub scene: String,
    pub sampler: &'static str,
    pub sigma: Summary,
    /// The share of draws that end without a light, as a mean over the lit shading points.
    pub dead: f64,
}

/// The edge of cells that share cuts: that of the library's default, in metres.
const EDGE: f32 = 0.25;

/// The rows of a scene: the published samplers, this library in two levels, one tree of this library over
/// the same lights, and two levels with shared cuts.
pub fn rows(scene: &TortureScene) -> Result<Vec<TortureRow>, SceneError> {
    let (lights, ids, cuts) = prepare(scene)?;
    let mut choosers = samplers::published(&lights, &ids)?;
    choosers.extend(own(scene, &lights, &ids, &cuts)?);
    Ok(rows_of(scene, &lights, &choosers))
}

/// The rows of this library alone: the last three of [`rows`].
pub fn own_rows(scene: &TortureScene) -> Result<[TortureRow; 3], SceneError> {
    let (lights, ids, cuts) = prepare(scene)?;
    let rows = rows_of(scene, &lights, &own(scene, &lights, &ids, &cuts)?);
    Ok(rows.try_into().ok().expect("one row for each sampler"))
}

fn prepare(scene: &TortureScene) -> Result<(Vec<Light>, Vec<LightId>, CutTable), SceneError> {
    let ids = scene.world.sampler().all_lights().collect();
    let cuts = shared_cuts::table(&scene.world, &scene.shading_points, EDGE);
    Ok((carried(&scene.world), ids, cuts.map_err(|error| SceneError(error.to_string()))?))
}

fn own<'a>(
    scene: &'a TortureScene,
    lights: &[Light],
    ids: &'a [LightId],
    cuts: &'a CutTable,
) -> Result<[Box<dyn Chooser + 'a>; 3], WorldError> {
    let shared = samplers::shared("shared cuts", &scene.world, cuts);
    Ok([samplers::two_level(&scene.world), samplers::flat(lights, ids)?, shared])
}

fn rows_of(scene: &TortureScene, lights: &[Light], choosers: &[Box<dyn Chooser + '_>]) -> Vec<TortureRow> {
    let lux: Vec<Vec<f32>> = scene.shading_points.par_iter().map(|at| reflections(lights, at)).collect();
    choosers.iter().map(|chooser| row(scene, chooser.as_ref(), &lux)).collect()
}

fn row(scene: &TortureScene, chooser: &dyn Chooser, lux: &[Vec<f32>]) -> TortureRow {
    let (sigma, dead) = samplers::noise(chooser, &scene.shading_points, lux);
    TortureRow { scene: scene.name.clone(), sampler: chooser.name(), sigma, dead }
}

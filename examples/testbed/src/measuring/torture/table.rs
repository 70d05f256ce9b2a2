//! What each sampler achieves on a scene of the set.

use super::TortureScene;
use crate::measuring::lights::{carried, reflections};
use crate::measuring::samplers::{self, Chooser};
use crate::measuring::sigma::Summary;
use girandole::{Light, LightId, WorldError};
use rayon::prelude::*;

/// The noise of one sampler on one scene.
pub struct TortureRow {
    pub scene: String,
    pub sampler: &'static str,
    pub sigma: Summary,
    /// The share of draws that end without a light, as a mean over the lit shading points.
    pub dead: f64,
}

/// The rows of a scene: the published samplers, this library in two levels, and one tree of this
/// library over the same lights.
pub fn rows(scene: &TortureScene) -> Result<Vec<TortureRow>, WorldError> {
    let lights = carried(&scene.world);
    let ids: Vec<LightId> = scene.world.sampler().all_lights().collect();
    let mut choosers = samplers::published(&lights, &ids)?;
    choosers.extend(own(scene, &lights, &ids)?);
    Ok(rows_of(scene, &lights, &choosers))
}

/// The rows of this library alone: two levels, and one tree over the same lights.
pub fn own_rows(scene: &TortureScene) -> Result<[TortureRow; 2], WorldError> {
    let lights = carried(&scene.world);
    let ids: Vec<LightId> = scene.world.sampler().all_lights().collect();
    let rows = rows_of(scene, &lights, &own(scene, &lights, &ids)?);
    Ok(rows.try_into().ok().expect("one row for each sampler"))
}

fn own<'a>(
    scene: &'a TortureScene,
    lights: &[Light],
    ids: &'a [LightId],
) -> Result<[Box<dyn Chooser + 'a>; 2], WorldError> {
    Ok([samplers::two_level(&scene.world), samplers::flat(lights, ids)?])
}

fn rows_of(scene: &TortureScene, lights: &[Light], choosers: &[Box<dyn Chooser + '_>]) -> Vec<TortureRow> {
    let lux: Vec<Vec<f32>> = scene.shading_points.par_iter().map(|at| reflections(lights, at)).collect();
    choosers.iter().map(|chooser| row(scene, chooser.as_ref(), &lux)).collect()
}

fn row(scene: &TortureScene, chooser: &dyn Chooser, lux: &[Vec<f32>]) -> TortureRow {
    let (sigma, dead) = samplers::noise(chooser, &scene.shading_points, lux);
    TortureRow { scene: scene.name.clone(), sampler: chooser.name(), sigma, dead }
}

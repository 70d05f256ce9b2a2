//! What each sampler achieves on a scene of the set.

use super::TortureScene;
use crate::measuring::lights::{carried, reflections};
use crate::measuring::samplers::{self, Chooser};
use crate::measuring::sigma::Summary;
use girandole::{LightId, WorldError};
use rayon::prelude::*;

/// The noise of one sampler on one scene.
pub struct TortureRow {
    pub scene: &'static str,
    pub sampler: &'static str,
    pub sigma: Summary,
    /// The share of draws that end without a light, as a mean over the lit shading points.
    pub dead: f64,
}

/// The rows of a scene: uniform, flux, both variants of pbrt, Cycles, this library in two levels,
/// and one tree of this library over the same lights.
pub fn rows(scene: &TortureScene) -> Result<Vec<TortureRow>, WorldError> {
    let lights = carried(&scene.world);
    let ids: Vec<LightId> = scene.world.sampler().all_lights().collect();
    let mut choosers = Vec::from(samplers::published(&lights, &ids));
    choosers.push(samplers::two_level(&scene.world));
    choosers.push(samplers::flat(&lights, &ids)?);
    let lux: Vec<Vec<f32>> = scene.shading_points.par_iter().map(|at| reflections(&lights, at)).collect();
    Ok(choosers.iter().map(|chooser| row(scene, chooser.as_ref(), &lux)).collect())
}

fn row(scene: &TortureScene, chooser: &dyn Chooser, lux: &[Vec<f32>]) -> TortureRow {
    let (sigma, dead) = samplers::noise(chooser, &scene.shading_points, lux);
    TortureRow { scene: scene.name, sampler: chooser.name(), sigma, dead }
}

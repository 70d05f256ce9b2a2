//! What each sampler achieves on a scene of the set.

use super::TortureScene;
use crate::measuring::lights::{carried, reflections};
use crate::measuring::sigma::Summary;
use crate::measuring::{samplers, shared_cuts};
use crate::scene::SceneError;
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

/// The rows of a scene: the published samplers unless `own_only`, this library in two levels, one tree of this library
/// over the same lights, and two levels with shared cuts.
pub fn rows(scene: &TortureScene, own_only: bool) -> Result<Vec<TortureRow>, SceneError> {
    let (lights, ids) = (carried(&scene.world), scene.world.sampler().all_lights().collect::<Vec<_>>());
    let cuts = shared_cuts::table(&scene.world, &scene.shading_points, EDGE);
    let cuts = cuts.map_err(|error| SceneError(error.to_string()))?;
    let mut choosers = if own_only { Vec::new() } else { samplers::published(&lights, &ids)? };
    choosers.push(samplers::two_level(&scene.world));
    choosers.push(samplers::flat(&lights, &ids)?);
    choosers.push(samplers::shared("shared cuts", &scene.world, &cuts));
    let lux: Vec<Vec<f32>> = scene.shading_points.par_iter().map(|at| reflections(&lights, at)).collect();
    let row = |chooser: &samplers::Chooser<'_>| {
        let (sigma, dead) = samplers::noise(chooser, &scene.shading_points, &lux);
        TortureRow { scene: scene.name.clone(), sampler: chooser.name(), sigma, dead }
    };
    Ok(choosers.iter().map(row).collect())
}

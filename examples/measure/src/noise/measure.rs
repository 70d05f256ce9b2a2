//! The rows of one scene: all samplers, measured at the same shading points.

use super::effort::Effort;
use super::stages::Lit;
use super::timing::nanoseconds;
use girandole::LightId;
use rayon::prelude::*;
use testbed::measuring::lights::{carried, illuminances};
use testbed::measuring::sigma::Summary;
use testbed::measuring::{samplers, shared_cuts};
use testbed::scene::SceneError;

/// The edges of cells that share cuts, in metres.
const CELLS: [(&str, f32); 4] =
    [("shared cuts, 0.25 m", 0.25), ("shared cuts, 0.5 m", 0.5), ("shared cuts, 1 m", 1.0), ("shared cuts, 4 m", 4.0)];

/// One sampler on one scene.
pub struct Row {
    pub scene: String,
    pub sampler: &'static str,
    pub sigma: Summary,
    /// The share of draws that end without a light, as a mean over the lit shading points.
    pub dead: f64,
    pub ns_per_sample: f64,
    /// The same with the build of a cell that as many samples as [`shared_cuts::NEIGHBOURS`] choose from.
    pub ns_with_build: f64,
    pub bytes_per_light: f64,
}

/// The rows of a scene, and the scene in numbers.
pub struct Measured {
    pub rows: Vec<Row>,
    pub lights: usize,
    pub instances: usize,
    /// Shading points that any light reaches. The others say nothing about a sampler.
    pub lit_shading_points: usize,
}

/// Measures all samplers on a scene.
pub fn measure(lit: &Lit, effort: Effort) -> Result<Measured, SceneError> {
    let lights = carried(&lit.world);
    let sampler = lit.world.sampler();
    let ids: Vec<LightId> = sampler.all_lights().collect();
    let table = |(name, edge): (&'static str, f32)| {
        let table = shared_cuts::table(&lit.world, &lit.shading_points, edge);
        table.map(|table| (name, table)).map_err(|error| SceneError(error.to_string()))
    };
    let tables = CELLS.into_iter().map(table).collect::<Result<Vec<_>, SceneError>>()?;
    let mut choosers = samplers::all(&lit.world, &lights, &ids)?;
    choosers.extend(tables.iter().map(|(name, table)| samplers::shared(name, &lit.world, table)));
    let lux: Vec<Vec<f32>> = lit.shading_points.par_iter().map(|at| illuminances(&lights, at)).collect();
    let lit_shading_points = lux.iter().filter(|lux| lux.iter().any(|lux| *lux > 0.0)).count();
    if lit_shading_points == 0 {
        return Err(SceneError(format!("{}: no light reaches any shading point", lit.name)));
    }
    let times = nanoseconds(&choosers, &lit.shading_points, effort);
    let builds = CELLS.iter().map(|(_, edge)| {
        let time = shared_cuts::build_time(&lit.world, &lit.shading_points, *edge, effort.select(5, 1));
        time.map(|ns| ns / shared_cuts::NEIGHBOURS as f64).map_err(|error| SceneError(error.to_string()))
    });
    let builds = builds.collect::<Result<Vec<_>, SceneError>>()?;
    // The samplers with cells come last.
    let builds = std::iter::repeat_n(0.0, choosers.len() - builds.len()).chain(builds);
    let rows = choosers.iter().zip(times).zip(builds).map(|((chooser, ns_per_sample), build)| {
        let (sigma, dead) = samplers::noise(chooser, &lit.shading_points, &lux);
        Row {
            scene: lit.name.clone(),
            sampler: chooser.name(),
            sigma,
            dead,
            ns_per_sample,
            ns_with_build: ns_per_sample + build,
            bytes_per_light: chooser.bytes() as f64 / lights.len() as f64,
        }
    });
    Ok(Measured {
        rows: rows.collect(),
        lights: lights.len(),
        instances: lit.world.instances().len(),
        lit_shading_points,
    })
}

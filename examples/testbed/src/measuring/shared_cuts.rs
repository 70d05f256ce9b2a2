//! Tables of shared cuts for shading points that were chosen one by one.

use crate::scene::rng::Rng;
use girandole::glam::Vec3;
use girandole::{CutOptions, CutTable, LightWorld, ShadingPoint, ValueError};
use std::time::Instant;

/// The points that are marked around each shading point: as many pixels as a cell has in a picture.
pub const NEIGHBOURS: u64 = 256;
/// The edge of the options over the least edge of cells that follow a view.
const SMALLEST: f32 = 8.0;
/// Seeds their places.
const SEED: u64 = 2_024;

/// A table with the cells of all shading points, each with an edge of `edge` metres and built for
/// neighbours that lie in the plane of the point's surface, or around a point in a volume. Glossy points
/// are seen by one camera, which stands where the view of the first of them ends.
pub fn table(world: &LightWorld, shading_points: &[ShadingPoint], edge: f32) -> Result<CutTable, ValueError> {
    let mut table = marked(world, shading_points, edge)?;
    table.build(world.sampler());
    Ok(table)
}

/// The nanoseconds in which one thread builds one of these cells: the least of `rounds`.
pub fn build_time(
    world: &LightWorld,
    shading_points: &[ShadingPoint],
    edge: f32,
    rounds: usize,
) -> Result<f64, ValueError> {
    let mut least = f64::INFINITY;
    for _ in 0..rounds {
        let mut table = marked(world, shading_points, edge)?;
        let start = Instant::now();
        table.build(world.sampler());
        least = least.min(start.elapsed().as_secs_f64() * 1.0e9 / table.report().built.max(1) as f64);
    }
    Ok(least)
}

/// The table before the build.
pub fn marked(world: &LightWorld, shading_points: &[ShadingPoint], edge: f32) -> Result<CutTable, ValueError> {
    let eye = shading_points.iter().find_map(|at| Some(at.position + at.gloss?.view));
    // With pixels that are so small, all cells have the least edge.
    let options_edge = if eye.is_some() { SMALLEST * edge } else { edge };
    let mut table = CutTable::new(CutOptions::new(options_edge, (16 * shading_points.len()).clamp(1, 1 << 16))?);
    if let Some(eye) = eye {
        table.set_view(eye.as_dvec3() + world.origin(), 1.0e-9);
    }
    mark(world, &table, shading_points, edge);
    Ok(table)
}

/// Marks the neighbours of all shading points.
pub fn mark(world: &LightWorld, table: &CutTable, shading_points: &[ShadingPoint], edge: f32) {
    let eye = shading_points.iter().find_map(|at| Some(at.position + at.gloss?.view));
    let sampler = world.sampler().with_cuts(table);
    for (index, at) in (0..).zip(shading_points) {
        let mut rng = Rng::new(SEED, index);
        for mut neighbour in neighbours(at, edge, &mut rng) {
            if let (Some(gloss), Some(eye)) = (&mut neighbour.gloss, eye) {
                gloss.view = eye - neighbour.position;
            }
            sampler.mark(&neighbour);
        }
    }
}

/// Points within an edge of a point, in its plane. Those in its cell are uniform there.
fn neighbours(at: &ShadingPoint, edge: f32, rng: &mut Rng) -> impl Iterator<Item = ShadingPoint> {
    (0..NEIGHBOURS).map(move |_| {
        let shift = Vec3::from_array([(); 3].map(|()| rng.range(-edge, edge)));
        let mut neighbour = *at;
        neighbour.position += shift - at.normal * shift.dot(at.normal);
        neighbour
    })
}

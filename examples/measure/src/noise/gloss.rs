//! The noise on glossy surfaces: of the light that they reflect toward the viewer.

use super::effort::Effort;
use super::stages;
use girandole::glam::Vec3;
use girandole::{Gloss, LightId, LightWorld, ShadingPoint};
use rayon::prelude::*;
use std::path::Path;
use std::time::Instant;
use testbed::common::pcg::Rng;
use testbed::common::table::{Table, markdown_head};
use testbed::measuring::lights::{carried, reflections};
use testbed::measuring::samplers;
use testbed::measuring::shared_cuts;
use testbed::measuring::sigma::{Noise, Summary};
use testbed::measuring::torture::{self, gloss};
use testbed::scene::SceneError;
use testbed::scene::procedural::Size;

const COLUMNS: [&str; 8] = ["scene", "surface", "roughness", "sampler", "sigma_mean", "sigma_p95", "sigma_rms", "ns"];
const SUMMARY: [&str; 11] = [
    "scene",
    "surface",
    "roughness",
    "with gloss",
    "cosine only",
    "pbrt",
    "sg tree",
    "sg tree, wide",
    "shared cuts, 0.25 m",
    "shared cuts, 1 m",
    "ratio to cosine",
];

/// A surface of some roughness.
type Surface = fn(f32) -> Gloss;

const SURFACES: [(&str, Surface); 2] = [("coated", gloss::coated), ("metal", gloss::metal)];
const ROUGHNESS: [f32; 6] = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5];
/// Choices that are timed.
const TIMED: usize = 20_000;
const ROUNDS: usize = 5;

/// The edges of cells that share cuts, in metres.
const CELLS: [(&str, f32); 2] =
    [("girandole with gloss, shared cuts, 0.25 m", 0.25), ("girandole with gloss, shared cuts, 1 m", 1.0)];
/// The length of views in metres: the distance of the camera that sees a point.
const VIEW: f32 = 10.0;

fn matte(at: &ShadingPoint) -> ShadingPoint {
    ShadingPoint::surface(at.position, at.normal)
}

/// Nanoseconds per choice. `choose` gets the index of a point.
fn nanoseconds<T>(choose: impl Fn(usize, [f32; 2]) -> T, points: usize, effort: Effort) -> f64 {
    let (rounds, timed) = effort.select((ROUNDS, TIMED), (1, 50));
    let mut rng = Rng::new(5, 5);
    let inputs: Vec<_> = (0..timed).map(|i| (i % points, [rng.unit(), rng.unit()])).collect();
    let round = |_| {
        let start = Instant::now();
        for (at, u) in &inputs {
            std::hint::black_box(choose(*at, *u));
        }
        start.elapsed().as_secs_f64() * 1.0e9 / timed as f64
    };
    (0..rounds).map(round).fold(f64::INFINITY, f64::min)
}

/// The noise and the time of a choice from the cuts of cells with an edge. Each point has a camera of its own,
/// and so a table of its own.
fn shared(
    world: &LightWorld,
    edge: f32,
    (points, light): (&[ShadingPoint], &[Vec<f32>]),
    effort: Effort,
) -> Result<(Summary, f64), SceneError> {
    let table = |at| shared_cuts::table(world, std::slice::from_ref(at), edge);
    let tables = points.par_iter().map(table).collect::<Result<Vec<_>, _>>();
    let tables = tables.map_err(|error| SceneError(error.to_string()))?;
    let choosers: Vec<_> = tables.iter().map(|table| samplers::shared("shared", world, table)).collect();
    let cases = choosers.par_iter().zip(points).zip(light);
    let noises: Vec<Noise> = cases.filter_map(|((chooser, at), light)| Noise::of(light, &chooser.pmfs(at))).collect();
    let ns = nanoseconds(|point, u| choosers[point].choose(&points[point], u), points.len(), effort);
    Ok((Summary::of(&noises), ns))
}

/// Measures one scene. `points` returns the shading points for a surface.
fn measure(
    name: &str,
    world: &LightWorld,
    points: impl Fn(Gloss) -> Vec<ShadingPoint>,
    effort: Effort,
    table: &mut Table,
) -> Result<(), SceneError> {
    let lights = carried(world);
    let ids: Vec<LightId> = world.sampler().all_lights().collect();
    let published = samplers::published(&lights, &ids)?;
    let named = |name| published.iter().find(|chooser| chooser.name() == name);
    let ours = samplers::two_level(world);
    for (surface, make) in SURFACES {
        for roughness in ROUGHNESS {
            let glossy = points(make(roughness));
            let flat: Vec<ShadingPoint> = glossy.iter().map(matte).collect();
            let light: Vec<Vec<f32>> = glossy.par_iter().map(|at| reflections(&lights, at)).collect();
            let cases = [
                ("girandole with gloss", Some(&ours), &glossy),
                ("girandole", Some(&ours), &flat),
                ("pbrt", named("pbrt"), &flat),
                ("sg tree", named("sg tree"), &glossy),
                ("sg tree, wide", named("sg tree, wide"), &glossy),
            ];
            let mut measured = Vec::new();
            for (sampler, chooser, points) in cases {
                let Some(chooser) = chooser else { continue };
                let (sigma, _) = samplers::noise(chooser, points, &light);
                let ns = nanoseconds(|point, u| chooser.choose(&points[point], u), points.len(), effort);
                measured.push((sampler, sigma, ns));
            }
            for (sampler, edge) in CELLS {
                let (sigma, ns) = shared(world, edge, (&glossy, &light), effort)?;
                measured.push((sampler, sigma, ns));
            }
            for (sampler, sigma, ns) in &measured {
                let numbers = [sigma.mean, sigma.p95, sigma.rms].map(|sigma| format!("{sigma:.3}"));
                let head = [name.into(), surface.into(), roughness.to_string(), (*sampler).to_owned()];
                table.add(head.into_iter().chain(numbers).chain([format!("{ns:.0}")])).map_err(SceneError)?;
            }
            let cells: Vec<String> =
                measured.iter().map(|(_, sigma, ns)| format!("{:.2} ({ns:.0} ns)", sigma.mean)).collect();
            testbed::say!(
                "| {name} | {surface} | {roughness} | {} | {:.2} |",
                cells.join(" | "),
                measured[0].1.mean / measured[1].1.mean
            );
        }
    }
    Ok(())
}

/// A view of a surface for each shading point: any direction above the horizon, of which grazing
/// ones are more frequent.
fn seen(points: &[ShadingPoint], gloss: Gloss) -> Vec<ShadingPoint> {
    let mut rng = Rng::new(31, 7);
    let seen = |at: &ShadingPoint| {
        let tangent = at.normal.any_orthonormal_vector();
        let (s, c) = rng.range(0.0, std::f32::consts::TAU).sin_cos();
        let cosine = rng.range(0.05, 1.0);
        let across = (tangent * s + at.normal.cross(tangent) * c) * (1.0 - cosine * cosine).sqrt();
        let view: Vec3 = at.normal * cosine + across;
        at.with_gloss(Gloss { view: view * VIEW, ..gloss })
    };
    points.iter().map(seen).collect()
}

/// Measures, prints a table and writes it.
pub fn run(size: Size, count: usize, effort: Effort, out: &Path) -> Result<(), SceneError> {
    let mut table = Table::create(out, &COLUMNS).map_err(SceneError)?;
    testbed::say!("{}", markdown_head(&SUMMARY));
    for scene in torture::scenes().iter().filter(|scene| scene.name == "glossy floor") {
        measure("glossy floor", &scene.world, |floor| gloss::with_floor(scene, floor), effort, &mut table)?;
    }
    let [city, _] = stages::city(size, count)?;
    measure(&city.name, &city.world, |surface| seen(&city.shading_points, surface), effort, &mut table)
}

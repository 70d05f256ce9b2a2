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
use testbed::measuring::samplers::{self, Chooser};
use testbed::measuring::torture::{self, gloss};
use testbed::scene::SceneError;
use testbed::scene::procedural::Size;

const COLUMNS: [&str; 8] = ["scene", "surface", "roughness", "sampler", "sigma_mean", "sigma_p95", "sigma_rms", "ns"];
const SUMMARY: [&str; 9] = [
    "scene",
    "surface",
    "roughness",
    "with gloss",
    "cosine only",
    "pbrt",
    "sg tree",
    "sg tree, wide",
    "ratio to cosine",
];

/// A surface of some roughness.
type Surface = fn(f32) -> Gloss;

const SURFACES: [(&str, Surface); 2] = [("coated", gloss::coated), ("metal", gloss::metal)];
const ROUGHNESS: [f32; 6] = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5];
/// Choices that are timed.
const TIMED: usize = 20_000;
const ROUNDS: usize = 5;

fn matte(at: &ShadingPoint) -> ShadingPoint {
    ShadingPoint::surface(at.position, at.normal)
}

/// Nanoseconds per choice.
fn nanoseconds(chooser: &dyn Chooser, points: &[ShadingPoint], effort: Effort) -> f64 {
    let (rounds, timed) = effort.select((ROUNDS, TIMED), (1, 50));
    let mut rng = Rng::new(5, 5);
    let inputs: Vec<_> = (0..timed).map(|i| (points[i % points.len()], [rng.unit(), rng.unit()])).collect();
    let round = |_| {
        let start = Instant::now();
        for (at, u) in &inputs {
            std::hint::black_box(chooser.choose(at, *u));
        }
        start.elapsed().as_secs_f64() * 1.0e9 / timed as f64
    };
    (0..rounds).map(round).fold(f64::INFINITY, f64::min)
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
            let mut means = Vec::new();
            let cases = [
                ("girandole with gloss", Some(&ours), &glossy),
                ("girandole", Some(&ours), &flat),
                ("pbrt", named("pbrt"), &flat),
                ("sg tree", named("sg tree"), &glossy),
                ("sg tree, wide", named("sg tree, wide"), &glossy),
            ];
            for (sampler, chooser, points) in cases {
                let Some(chooser) = chooser else { continue };
                let (sigma, _) = samplers::noise(chooser.as_ref(), points, &light);
                let ns = nanoseconds(chooser.as_ref(), points, effort);
                let numbers = [sigma.mean, sigma.p95, sigma.rms].map(|sigma| format!("{sigma:.3}"));
                let [mean, p95, rms] = numbers;
                let row = [
                    name.into(),
                    surface.into(),
                    roughness.to_string(),
                    sampler.into(),
                    mean,
                    p95,
                    rms,
                    format!("{ns:.0}"),
                ];
                table.add(row).map_err(SceneError)?;
                means.push((sigma.mean, ns));
            }
            let cells: Vec<String> = means.iter().map(|(mean, ns)| format!("{mean:.2} ({ns:.0} ns)")).collect();
            testbed::say!(
                "| {name} | {surface} | {roughness} | {} | {:.2} |",
                cells.join(" | "),
                means[0].0 / means[1].0
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
        at.with_gloss(Gloss { view, ..gloss })
    };
    points.iter().map(seen).collect()
}

/// Measures, prints a table and writes it.
pub fn run(size: Size, count: usize, effort: Effort, out: &Path) -> Result<(), SceneError> {
    let mut table = Table::create(out, &COLUMNS).map_err(SceneError)?;
    testbed::say!("{}", markdown_head(&SUMMARY));
    for scene in torture::scenes()?.iter().filter(|scene| scene.name == "glossy floor") {
        measure("glossy floor", &scene.world, |floor| gloss::with_floor(scene, floor), effort, &mut table)?;
    }
    let [city, _] = stages::city(size, count)?;
    measure(&city.name, &city.world, |surface| seen(&city.shading_points, surface), effort, &mut table)
}

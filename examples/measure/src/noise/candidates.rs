//! Samples that are chosen from several candidates: the noise of unshadowed illuminance, and time.

use super::effort::Effort;
use super::stages::{self, Lit};
use girandole::light::luminance;
use girandole::{LightSampler, ShadingPoint};
use rayon::prelude::*;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;
use testbed::common::table::{Table, markdown_head};
use testbed::scene::SceneError;
use testbed::scene::procedural::Size;
use testbed::scene::rng::Rng;

/// The numbers of candidates that are measured.
const CANDIDATES: [u32; 6] = [1, 2, 4, 8, 16, 32];
/// Estimates per shading point. They give a deviation to about 2 %, and the mean of 400 deviations
/// far better.
const ESTIMATES: u32 = 2_000;
/// Numbers of candidates take turns for this many rounds, and the fastest round counts.
const ROUNDS: usize = 15;
/// Estimates of one number of candidates in a round.
const TIMED: usize = 4_000;

const COLUMNS: [&str; 5] = ["scene", "candidates", "rmse", "rmse_independent", "ns_per_estimate"];

fn numbers(rng: &mut Rng) -> [f32; 5] {
    std::array::from_fn(|_| rng.unit())
}

/// The unshadowed illuminance in lux, estimated by one chosen candidate.
fn estimate(sampler: &LightSampler<'_>, shading_point: &ShadingPoint, u: [f32; 5], candidates: u32) -> f64 {
    let kept = sampler.resample(shading_point, u, candidates);
    sampler.reservoir_sample(shading_point, &kept).map_or(0.0, |sample| {
        let incident = sample.incident;
        let lux = luminance(incident.radiance) * incident.direction.dot(shading_point.normal).max(0.0);
        f64::from(lux) / f64::from(sample.pmf * incident.pdf)
    })
}

/// The root mean square error of one estimate at a shading point, relative to the mean of all
/// estimates, for each number of candidates. `None` where no light arrives.
fn errors(
    sampler: &LightSampler<'_>,
    shading_point: &ShadingPoint,
    (stream, estimates): (u64, u32),
) -> Option<[f64; CANDIDATES.len()]> {
    let mut rng = Rng::new(11, stream);
    let moments = CANDIDATES.map(|candidates| {
        let values = (0..estimates).map(|_| estimate(sampler, shading_point, numbers(&mut rng), candidates));
        let (sum, squares) = values.fold((0.0, 0.0), |(sum, squares), v| (sum + v, squares + v * v));
        (sum / f64::from(estimates), squares / f64::from(estimates))
    });
    // Estimates of more candidates have less noise: each mean is weighted by its number of
    // candidates.
    let weights = CANDIDATES.map(f64::from);
    let mean = moments.iter().zip(weights).map(|((mean, _), w)| mean * w).sum::<f64>() / weights.iter().sum::<f64>();
    (mean > 0.0).then(|| moments.map(|(sum, square)| (square - sum * sum).max(0.0).sqrt() / mean))
}

fn nanoseconds(sampler: &LightSampler<'_>, shading_points: &[ShadingPoint], effort: Effort) -> [f64; CANDIDATES.len()] {
    let (rounds, timed) = effort.select((ROUNDS, TIMED), (1, 50));
    let mut rng = Rng::new(12, 0);
    let inputs: Vec<_> = (0..timed).map(|i| (shading_points[i % shading_points.len()], numbers(&mut rng))).collect();
    let mut fastest = [f64::INFINITY; CANDIDATES.len()];
    for _ in 0..rounds {
        for (candidates, fastest) in CANDIDATES.into_iter().zip(&mut fastest) {
            let start = Instant::now();
            for (shading_point, u) in &inputs {
                black_box(sampler.reservoir_sample(shading_point, &sampler.resample(shading_point, *u, candidates)));
            }
            *fastest = fastest.min(start.elapsed().as_secs_f64() * 1.0e9 / timed as f64);
        }
    }
    fastest
}

fn measure(lit: &Lit, effort: Effort) -> Result<Vec<[String; 5]>, SceneError> {
    let sampler = lit.world.sampler();
    let one =
        |(stream, at): (usize, &ShadingPoint)| errors(&sampler, at, (stream as u64, effort.select(ESTIMATES, 20)));
    let all: Vec<_> = lit.shading_points.par_iter().enumerate().filter_map(one).collect();
    if all.is_empty() {
        return Err(SceneError(format!("{}: no light reaches any shading point", lit.name)));
    }
    let times = nanoseconds(&sampler, &lit.shading_points, effort);
    let mean = |i: usize| all.iter().map(|errors| errors[i]).sum::<f64>() / all.len() as f64;
    let row = |(i, candidates): (usize, &u32)| {
        // The error of the mean of as many independent samples.
        let independent = mean(0) / f64::from(*candidates).sqrt();
        let [rmse, independent] = [mean(i), independent].map(|rmse| format!("{rmse:.3}"));
        [lit.name.clone(), candidates.to_string(), rmse, independent, format!("{:.0}", times[i])]
    };
    Ok(CANDIDATES.iter().enumerate().map(row).collect())
}

/// Measures, prints the table and writes it.
pub fn run(size: Size, gltf: Option<&Path>, (count, effort): (usize, Effort), out: &Path) -> Result<(), SceneError> {
    let mut table = Table::create(out, &COLUMNS).map_err(SceneError)?;
    let [city, _] = stages::city(size, count)?;
    let mut scenes = vec![city];
    if let Some(path) = gltf {
        scenes.push(stages::gltf(path, count)?);
    }
    testbed::say!("{}", markdown_head(&COLUMNS));
    for scene in &scenes {
        for row in measure(scene, effort)? {
            testbed::say!("| {} |", row.join(" | "));
            table.add(row).map_err(SceneError)?;
        }
    }
    Ok(())
}

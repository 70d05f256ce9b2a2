//! The noise of the light that fog scatters into camera rays: of the choice of a light for a
//! segment of a ray, and of a light and a point of the segment together.

use super::effort::Effort;
use super::stages::moved;
use girandole::glam::{Vec2, Vec3};
use girandole::{Light, LightId, LightSampler, ShadingPoint};
use rayon::prelude::*;
use std::path::Path;
use std::time::Instant;
use testbed::common::pcg::Rng;
use testbed::common::table::{Table, markdown_head};
use testbed::direct_light::view::first_surface;
use testbed::measuring::in_scattering::{Ray, in_scattered};
use testbed::measuring::irradiance::irradiance;
use testbed::measuring::lights::{carried, illuminances};
use testbed::measuring::samplers::{self, Chooser};
use testbed::measuring::sigma::{Noise, Summary};
use testbed::render::geometry::Geometry;
use testbed::render::shading::View;
use testbed::scene::procedural::{self, CityOptions, Size};
use testbed::scene::{SceneError, Stage, gltf_scene};

const COLUMNS: [&str; 9] =
    ["scene", "segments", "what", "sampler", "sigma_mean", "sigma_median", "sigma_p95", "unreached", "ns"];
const SUMMARY: [&str; 6] = ["scene", "segments", "what", "sampler", "sigma: mean, median, 95 %", "ns"];

/// A cut of camera rays into segments.
struct Cut {
    name: &'static str,
    /// Where a segment starts and how long it is, for a random number and the length of the ray.
    cut: fn(f32, f32) -> (f32, f32),
}

/// The end of rays that hit nothing, in metres.
const FAR: f32 = 100.0;
/// Slices of a froxel grid whose depths grow exponentially from [`NEAR`] to [`FAR`].
const SLICES: f32 = 64.0;
const NEAR: f32 = 0.5;

fn piece(u: f32, ray: f32, length: f32) -> (f32, f32) {
    let length = length.min(ray);
    (u * (ray - length), length)
}

const CUTS: [Cut; 5] = [
    Cut { name: "0.1 m", cut: |u, ray| piece(u, ray, 0.1) },
    Cut { name: "1 m", cut: |u, ray| piece(u, ray, 1.0) },
    Cut { name: "10 m", cut: |u, ray| piece(u, ray, 10.0) },
    Cut { name: "whole ray", cut: |_, ray| (0.0, ray) },
    Cut {
        name: "froxel",
        cut: |u, ray| {
            let slices = SLICES * (ray.max(NEAR) / NEAR).ln() / (FAR / NEAR).ln();
            let depth = |slice: f32| NEAR * (FAR / NEAR).powf(slice / SLICES);
            let slice = (u * slices).floor();
            (depth(slice), depth(slice + 1.0) - depth(slice))
        },
    },
];

/// Places along a segment at which integrals over the choice of a point are taken.
const PLACES: usize = 64;
/// Segments for which the whole estimate is measured.
const WHOLE: usize = 60;
/// The extinction of the fog that the choice does not know, per metre: one sees 100 m far.
const EXTINCTION: f64 = 0.03;
/// Choices that are timed.
const TIMED: usize = 8_000;
const ROUNDS: usize = 15;

/// Camera rays through random pixels, as far as they see or [`FAR`].
fn rays(stage: &Stage, count: usize) -> Result<Vec<(Vec3, Vec3, f32, f32)>, SceneError> {
    let geometry = Geometry::new(&stage.scene)?;
    let view = View::new(&stage.scene.camera, 16, 9);
    let mut rng = Rng::new(77, 1);
    let ray = |_| {
        let pixel = Vec2::new(rng.range(0.0, 16.0), rng.range(0.0, 9.0));
        let direction = view.direction(pixel, Vec2::new(16.0, 9.0));
        let hit = first_surface(&geometry, view.eye, direction);
        let length = hit.map_or(FAR, |surface| surface.shading_point.position.distance(view.eye).min(FAR));
        (view.eye, direction, length, rng.unit())
    };
    Ok((0..count).map(ray).collect())
}

/// The second moment, over the choice of a point and of a light, of an estimate of the integral
/// over a segment; divided by the square of the integral.
fn whole_by_points(sampler: &LightSampler, lights: &[Light], ray: &Ray, exact: f64) -> Option<Noise> {
    let mut pmfs = Vec::new();
    let (mut second, mut has_unreached) = (0.0, false);
    for place in 0..PLACES {
        let point = ray.point(ray.length * (place as f64 + 0.5) / PLACES as f64);
        sampler.distribution(&point, &mut pmfs);
        for (lux, pmf) in illuminances(lights, &point).into_iter().zip(&pmfs) {
            let lux = f64::from(lux) * ray.length;
            has_unreached |= lux > 0.0 && *pmf <= 0.0;
            if *pmf > 0.0 {
                second += lux * lux / f64::from(*pmf) / PLACES as f64;
            }
        }
    }
    Some(Noise { sigma: (second / (exact * exact) - 1.0).max(0.0).sqrt(), has_unreached })
}

/// The same for a light that is chosen by `pmfs`, and then an equiangular or uniform distance.
fn whole_by_lights(
    sampler: &LightSampler,
    (lights, ids): (&[Light], &[LightId]),
    at: &ShadingPoint,
    pmfs: &[f32],
    (exact, is_equiangular): (f64, bool),
) -> Noise {
    let ray = Ray::of(at);
    let (mut second, mut has_unreached) = (0.0, false);
    for ((light, id), pmf) in lights.iter().zip(ids).zip(pmfs) {
        let mut one = 0.0;
        for place in 0..PLACES {
            let u = (place as f32 + 0.5) / PLACES as f32;
            let value = if is_equiangular {
                let Some(point) = sampler.sample_along(at, *id, u) else { break };
                irradiance(light, &point.shading_point) / f64::from(point.pdf)
            } else {
                irradiance(light, &ray.point(f64::from(u) * ray.length)) * ray.length
            };
            one += value * value / PLACES as f64;
        }
        has_unreached |= one > 0.0 && *pmf <= 0.0;
        if *pmf > 0.0 {
            second += one / f64::from(*pmf);
        }
    }
    Noise { sigma: (second / (exact * exact) - 1.0).max(0.0).sqrt(), has_unreached }
}

/// Nanoseconds per choice at some shading points, in turns.
fn nanoseconds<const N: usize>(chooser: &Chooser<'_>, sets: [&[ShadingPoint]; N], effort: Effort) -> [f64; N] {
    let (rounds, timed) = effort.select((ROUNDS, TIMED), (1, 50));
    let mut rng = Rng::new(5, 5);
    let numbers: Vec<_> = (0..timed).map(|_| [rng.unit(), rng.unit()]).collect();
    let mut best = [f64::INFINITY; N];
    for _ in 0..rounds {
        for (best, points) in best.iter_mut().zip(sets) {
            let start = Instant::now();
            for (i, u) in numbers.iter().enumerate() {
                std::hint::black_box(chooser.choose(&points[i % points.len()], *u));
            }
            *best = best.min(start.elapsed().as_secs_f64() * 1.0e9 / timed as f64);
        }
    }
    best
}

fn measure(name: &str, stage: &Stage, (count, effort): (usize, Effort), table: &mut Table) -> Result<(), SceneError> {
    let world = &stage.world;
    let (lights, sampler) = (carried(world), world.sampler());
    let ids: Vec<LightId> = sampler.all_lights().collect();
    let published = samplers::published(&lights, &ids)?;
    let ours = samplers::two_level(world);
    let rays = rays(stage, count)?;
    for cut in CUTS {
        let segments: Vec<ShadingPoint> = rays
            .iter()
            .map(|(eye, direction, length, u)| {
                let (start, length) = (cut.cut)(*u, *length);
                ShadingPoint::segment(*eye + *direction * start, *direction, length)
            })
            .collect();
        let middles: Vec<ShadingPoint> = segments.iter().map(|at| ShadingPoint::volume(at.position)).collect();
        let lit = |panels: usize, at: &ShadingPoint| -> Vec<f32> {
            let ray = Ray::of(at);
            lights.iter().map(|light| in_scattered(light, &ray, panels) as f32).collect()
        };
        let light: Vec<Vec<f32>> = segments.par_iter().map(|at| lit(1, at)).collect();
        let error = |(at, coarse): (&ShadingPoint, &Vec<f32>)| {
            let sum = |values: &[f32]| values.iter().map(|v| f64::from(*v)).sum::<f64>();
            (sum(coarse) / sum(&lit(3, at)) - 1.0).abs()
        };
        let error = segments.par_iter().zip(&light).take(20).map(error).reduce(|| 0.0, f64::max);
        testbed::say!(
            "quadrature: the integrals of {} change by at most {error:.1e} with three times the points",
            cut.name
        );
        let [of_segments, of_points] = nanoseconds(&ours, [&segments, &middles], effort);
        let mut rows = Vec::new();
        let choices: [(&str, &Chooser<'_>, &[ShadingPoint], f64); 4] = [
            ("segment", &ours, &segments, of_segments),
            ("its middle", &ours, &middles, of_points),
            ("uniform", &published[0], &middles, f64::NAN),
            ("flux", &published[1], &middles, f64::NAN),
        ];
        for (sampler, chooser, points, ns) in choices {
            rows.push(("choice", sampler, samplers::noise(chooser, points, &light).0, ns));
        }
        let fog = |at: &ShadingPoint| -> Vec<f32> {
            let ray = Ray { extinction: EXTINCTION, ..Ray::of(at) };
            lights.iter().map(|light| in_scattered(light, &ray, 1) as f32).collect()
        };
        let foggy: Vec<Vec<f32>> = segments.par_iter().map(fog).collect();
        rows.push(("choice in thick fog", "segment", samplers::noise(&ours, &segments, &foggy).0, f64::NAN));
        let whole: Vec<[Noise; 4]> = segments
            .par_iter()
            .zip(&light)
            .take(WHOLE)
            .filter_map(|(at, light)| {
                let exact = light.iter().map(|lux| f64::from(*lux)).sum::<f64>();
                let pmfs = ours.pmfs(at);
                let all = (lights.as_slice(), ids.as_slice());
                let middle = ours.pmfs(&ShadingPoint::volume(at.position));
                (exact > 0.0).then(|| {
                    Some([
                        whole_by_lights(&sampler, all, at, &pmfs, (exact, true)),
                        whole_by_lights(&sampler, all, at, &middle, (exact, true)),
                        whole_by_lights(&sampler, all, at, &pmfs, (exact, false)),
                        whole_by_points(&sampler, &lights, &Ray::of(at), exact)?,
                    ])
                })?
            })
            .collect();
        for (i, sampler) in ["segment, equiangular", "middle, equiangular", "segment, uniform", "uniform point, tree"]
            .into_iter()
            .enumerate()
        {
            let noises: Vec<Noise> = whole.iter().map(|all| all[i]).collect();
            rows.push(("estimate", sampler, Summary::of(&noises), f64::NAN));
        }
        for (what, sampler, sigma, ns) in rows {
            let Summary { mean, median, p95, unreached, .. } = sigma;
            let ns = if ns.is_nan() { String::new() } else { format!("{ns:.0}") };
            let cells = [name, cut.name, what, sampler].map(String::from);
            testbed::say!("| {} | {mean:.2}, {median:.2}, {p95:.2} ({unreached}) | {ns} |", cells.join(" | "));
            let numbers = [mean, median, p95].map(|sigma| format!("{sigma:.3}"));
            let row = cells.into_iter().chain(numbers).chain([unreached.to_string(), ns]);
            table.add(row).map_err(SceneError)?;
        }
    }
    Ok(())
}

/// Measures, prints a table and writes it.
pub fn run(size: Size, gltf: Option<&Path>, (count, effort): (usize, Effort), out: &Path) -> Result<(), SceneError> {
    let mut table = Table::create(out, &COLUMNS).map_err(SceneError)?;
    testbed::say!("{}", markdown_head(&SUMMARY));
    let city = moved(procedural::stage(&CityOptions { size, cars: None, seed: 1, lamp_profile: None })?)?;
    measure(&format!("city {size:?}"), &city, (count, effort), &mut table)?;
    if let Some(path) = gltf {
        let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        measure(&name, &moved(gltf_scene::stage(path, None)?)?, (count, effort), &mut table)?;
    }
    Ok(())
}

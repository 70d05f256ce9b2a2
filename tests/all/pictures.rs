//! The tool that renders one view by three samplers in the same time.

use crate::city;
use crate::city::render::geometry::Geometry;
use crate::city::scene::procedural::Size;
use crate::variance::{lights, samplers, sigma};
use girandole::LightId;
use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;

#[path = "../../examples/tools/pictures/modules.rs"]
#[allow(dead_code, missing_docs, reason = "a program")]
mod program;

use program::run::{Options, TITLES, run};
use program::sampling::Renderer;
use program::score::{Score, mean};
use program::view::View;

fn options(name: &str) -> Options {
    let out: PathBuf = std::env::temp_dir().join(format!("girandole_pictures_{name}_{}.png", std::process::id()));
    Options { out, world: Size::S, us_per_pixel: 100.0, samples: None, glossy: false, quick: true }
}

#[test]
fn three_pictures_of_equal_time_lie_side_by_side_with_labels_that_the_font_can_write() {
    let options = options("equal_time");
    let rows = run(&options).expect("it runs");
    let file = BufReader::new(File::open(&options.out).expect("the picture exists"));
    let size = png::Decoder::new(file).read_info().map(|reader| (reader.info().width, reader.info().height));
    std::fs::remove_file(&options.out).expect("the test made it");
    // Three pictures of 64 x 48 pixels, two gaps of 6 pixels, labels 50 pixels high.
    assert_eq!(size.expect("a PNG"), (3 * 64 + 2 * 6, 48 + 50));
    assert_eq!(rows.iter().map(|row| row.sampler).collect::<Vec<_>>(), ["flux", "pbrt opaque", "girandole"]);
    for (row, title) in rows.iter().zip(TITLES) {
        let us = row.samples * row.seconds_per_sample * 1.0e6;
        assert!((us / options.us_per_pixel - 1.0).abs() < 1.0e-9, "{row:?}");
        assert!((title.to_owned() + &row.label()).chars().all(program::font::has), "{title}, {}", row.label());
    }
    // The exact sigma does not depend on times.
    assert!(rows[2].sigma < 0.5 * rows[1].sigma && rows[1].sigma < rows[0].sigma, "{rows:?}");
}

/// Pictures of each sampler and of the reference.
const SEEDS: u32 = 24;
/// Samples per pixel: of flux, of pbrt-v4's formula, of Girandole, and of the reference. They take
/// about the same time.
const SAMPLES: [f64; 4] = [6.0, 2.4, 2.0, 4.0];
/// Student's t for 23 degrees of freedom, which chance exceeds once in 10,000 tries, both sides
/// together. With three comparisons that is one false alarm in 3,300 choices of seeds, and the
/// seeds are fixed.
const T_LIMIT: f64 = 4.69;
/// The largest standard errors of the three differences, relative to the mean. Wider intervals
/// would pass anything.
const MAX_ERRORS: [f64; 3] = [0.2, 0.05, 0.02];

#[test]
fn the_pictures_of_all_samplers_have_the_mean_of_the_reference_and_girandole_the_least_error() {
    let (scene, world) = program::run::city(Size::S, false).expect("a city");
    let geometry = Geometry::new(&scene).expect("a sound scene");
    let view = View::new(&scene, &geometry, (64, 48));
    let sampler = world.sampler();
    let ids: Vec<LightId> = sampler.all_lights().collect();
    let choosers = samplers::main_three(&world, &lights::carried(&world), &ids);
    let renderer = Renderer { scene: &scene, geometry: &geometry, view: &view, lights: sampler };
    let picture = |which: usize, samples: f64, seed: u32| renderer.picture(choosers[which].as_ref(), samples, seed);

    let reference: Vec<f64> = (0..SEEDS).map(|seed| mean(&picture(2, SAMPLES[3], 100 + seed))).collect();
    let level = reference.iter().sum::<f64>() / f64::from(SEEDS);
    for which in 0..3 {
        let means = (0..SEEDS).map(|seed| mean(&picture(which, SAMPLES[which], seed)));
        let differences: Vec<f64> = means.zip(&reference).map(|(mean, reference)| mean - reference).collect();
        let count = f64::from(SEEDS);
        let mean = differences.iter().sum::<f64>() / count;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let error = (variance / count).sqrt();
        assert!(mean.abs() <= T_LIMIT * error, "{}: off by {mean}, standard error {error}", TITLES[which]);
        assert!(error < MAX_ERRORS[which] * level, "{}: standard error {error} of {level}", TITLES[which]);
    }

    let reference = picture(2, 64.0, 1_000);
    let [flux, pbrt, girandole] = [0, 1, 2].map(|which| Score::new(&picture(which, SAMPLES[which], 0), &reference));
    assert!(girandole.mape < 0.7 * pbrt.mape && girandole.mape < 0.7 * flux.mape, "{girandole:?} {pbrt:?} {flux:?}");
    assert!(girandole.rel_mse < 0.3 * pbrt.rel_mse.min(flux.rel_mse), "{girandole:?} {pbrt:?} {flux:?}");
}

#[test]
fn errors_have_values_computed_by_hand() {
    use girandole::glam::Vec3;
    use program::score::Estimate;
    // 2,000 pixels: relMSE leaves out the two with the largest errors. The floor is 0.01.
    let reference = vec![Vec3::ONE; 2_000];
    let mut picture = reference.clone();
    (picture[0], picture[1], picture[2]) = (Vec3::splat(102.0), Vec3::ZERO, Vec3::splat(1.505));
    let score = Score::new(&picture, &reference);
    let near = |a: f64, b: f64| (a - b).abs() < 1.0e-6 * b;
    assert!(near(score.mape, (101.0 / 1.01 + 1.0 / 1.01 + 0.5) / 2_000.0), "{score:?}");
    assert!(near(score.rel_mse, 0.25 / 1_998.0), "{score:?}");
    assert!(near(score.mean, 2_100.505 / 2_000.0), "{score:?}");
    let estimate = Estimate::new([1.0, 2.0, 3.0, 2.0]);
    // The variance is 2/3, its standard error sqrt(2/3/4).
    assert!(near(estimate.mean, 2.0) && near(estimate.half_width, 3.182 / 6.0_f64.sqrt()), "{estimate:?}");
}

#[test]
fn too_little_time_for_one_sample_is_refused() {
    let options = Options { us_per_pixel: 0.1, ..options("no_time") };
    let error = run(&options).expect_err("a sample takes longer").to_string();
    std::fs::remove_file(&options.out).expect("the test made it");
    assert!(error.contains("0.1 microseconds") && error.contains("at least 1"), "{error}");
}

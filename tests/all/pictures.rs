//! The tool that renders one view by three samplers in the same time.

use crate::city;
use crate::city::render::geometry::Geometry;
use crate::city::scene::procedural::Size;
use crate::city::scene::{Scene, Stage};
use crate::small_scene;
use crate::variance::{lights, samplers, sigma};
use clap::Parser;
use girandole::glam::Vec3;
use girandole::{FrameBudget, LightId, LightWorld};
use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;

#[path = "../../examples/tools/pictures/modules.rs"]
#[allow(dead_code, missing_docs, reason = "a program")]
mod program;

use program::run::{Options, TITLES, run};
use program::sampling::Renderer;
use program::score::{Estimate, Score, mean};
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
        // Samples per pixel are rounded to hundredths.
        let samples = options.us_per_pixel * 1.0e-6 / row.seconds_per_sample;
        assert!((row.samples - samples).abs() < 0.005 + 1.0e-9, "{row:?}");
        assert!((title.to_owned() + &row.label()).chars().all(program::font::has), "{title}, {}", row.label());
    }
    // The exact sigma does not depend on times.
    assert!(rows[2].sigma < 0.5 * rows[1].sigma && rows[1].sigma < rows[0].sigma, "{rows:?}");
}

/// Samplers, and a renderer of what they choose.
struct Studio<'a> {
    renderer: Renderer<'a>,
    choosers: [Box<dyn samplers::Chooser + 'a>; 3],
}

/// Calls `test` with pictures of 64 x 48 pixels of a scene.
fn with_studio(scene: &Scene, world: &LightWorld, test: impl Fn(&Studio<'_>)) {
    let geometry = Geometry::new(scene).expect("a sound scene");
    let view = View::new(scene, &geometry, (64, 48));
    let sampler = world.sampler();
    let ids: Vec<LightId> = sampler.all_lights().collect();
    let choosers = samplers::main_three(world, &lights::carried(world), &ids);
    test(&Studio { renderer: Renderer { scene, geometry: &geometry, view: &view, lights: sampler }, choosers });
}

/// The sampler of the reference.
const GIRANDOLE: usize = 2;

impl Studio<'_> {
    fn picture(&self, which: usize, samples: f64, seed: u32) -> Vec<Vec3> {
        self.renderer.picture(self.choosers[which].as_ref(), samples, seed)
    }

    /// The mean of a sampler's pictures minus that of the reference, and the standard error of the
    /// difference, both relative to the reference. There are [`SEEDS`] independent pictures.
    fn difference(&self, which: usize, samples: f64) -> (f64, f64) {
        let reference: Vec<f64> = (0..SEEDS).map(|seed| mean(&self.picture(GIRANDOLE, 4.0, 100 + seed))).collect();
        let means = (0..SEEDS).map(|seed| mean(&self.picture(which, samples, seed)));
        let differences: Vec<f64> = means.zip(&reference).map(|(mean, reference)| mean - reference).collect();
        let count = f64::from(SEEDS);
        let level = reference.iter().sum::<f64>() / count;
        let mean = differences.iter().sum::<f64>() / count;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (count - 1.0);
        (mean / level, (variance / count).sqrt() / level)
    }
}

/// Pictures per mean.
const SEEDS: u32 = 24;
/// Student's t for 23 degrees of freedom, which chance exceeds once in 10,000 tries, both sides
/// together. With five comparisons that is one false alarm in 2,000 choices of seeds, and the seeds
/// are fixed.
const T_LIMIT: f64 = 4.69;

#[test]
fn the_pictures_of_all_samplers_of_a_small_scene_have_the_mean_of_the_reference() {
    let Stage { mut scene, mut world, .. } = small_scene::stage(true).expect("the small scene is sound");
    scene.materials.iter_mut().for_each(|material| (material.roughness, material.metallic) = (1.0, 0.0));
    let directionals: Vec<_> = world.directionals().map(|(key, _)| key).collect();
    directionals.into_iter().for_each(|key| world.remove_directional(key).expect("a live key"));
    world.update(FrameBudget::UNLIMITED);
    with_studio(&scene, &world, |studio| {
        for (which, name) in TITLES.into_iter().enumerate() {
            let (difference, error) = studio.difference(which, [20.0, 10.0, 5.0][which]);
            assert!(difference.abs() <= T_LIMIT * error, "{name}: off by {difference}, standard error {error}");
            // Wide intervals would pass anything.
            assert!(error < 0.01, "{name}: standard error {error}");
        }
    });
}

/// Samples per pixel of the three samplers that take about the same time in the city.
const EQUAL_TIME: [f64; 3] = [6.0, 2.4, 2.0];
/// The mean of flux may differ so much from the reference. Lights that flux chooses less than once
/// in 10,000 samples bring about 8 % of the light of the city's view, and most of them to a few
/// pixels only, so that far fewer samples than a normal distribution needs have seen them.
const RARE_LIGHT: f64 = 0.08;

#[test]
fn girandole_has_the_least_error_in_the_city_and_all_means_agree() {
    let (scene, world) = program::run::city(Size::S, false).expect("a city");
    with_studio(&scene, &world, |studio| {
        for which in [1, GIRANDOLE] {
            let (difference, error) = studio.difference(which, EQUAL_TIME[which]);
            let name = TITLES[which];
            assert!(difference.abs() <= T_LIMIT * error, "{name}: off by {difference}, standard error {error}");
            assert!(error < 0.02, "{name}: standard error {error}");
        }
        let (difference, error) = studio.difference(0, EQUAL_TIME[0]);
        assert!(difference.abs() < RARE_LIGHT + T_LIMIT * error, "flux: off by {difference}, standard error {error}");

        let reference = studio.picture(GIRANDOLE, 64.0, 1_000);
        let score = |which: usize| Score::new(&studio.picture(which, EQUAL_TIME[which], 0), &reference);
        let [flux, pbrt, girandole] = [0, 1, 2].map(score);
        let all = format!("{flux:?} {pbrt:?} {girandole:?}");
        assert!(girandole.mape < 0.7 * pbrt.mape && girandole.mape < 0.7 * flux.mape, "{all}");
        assert!(girandole.rel_mse < 0.3 * pbrt.rel_mse && girandole.rel_mse < 0.3 * flux.rel_mse, "{all}");
    });
}

#[test]
fn errors_have_values_computed_by_hand() {
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

#[test]
fn the_command_line_takes_three_numbers_of_samples_and_refuses_others() {
    let parse = |samples: &str| Options::try_parse_from(["pictures", "--out", "a.png", "--samples", samples]);
    assert_eq!(parse("46.63,19,16.5").expect("three numbers").samples, Some([46.63, 19.0, 16.5]));
    for refused in ["1,2", "1,2,3,4", "1,2,0.5", "1,2,nan", "1,2,x"] {
        assert!(parse(refused).is_err(), "{refused}");
    }
}

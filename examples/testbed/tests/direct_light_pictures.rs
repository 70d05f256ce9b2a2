//! The renderer of direct light that the programs which judge samplers share.

use girandole::glam::Vec3;
use girandole::{LightId, LightWorld};
use testbed::direct_light::converged;
use testbed::direct_light::draw::{Draw, Resampled, Single};
use testbed::direct_light::numbers::numbers;
use testbed::direct_light::renderer::Renderer;
use testbed::direct_light::rivals;
use testbed::direct_light::stage::prepare;
use testbed::direct_light::view::View;
use testbed::measuring::samplers::Chooser;
use testbed::measuring::score::{Estimate, Score, mean};
use testbed::measuring::{lights, samplers};
use testbed::render::geometry::Geometry;
use testbed::scene::procedural::{self, CityOptions, Size};
use testbed::scene::{Scene, Stage};
use testbed::testing::small_scene;

/// What a scene is drawn with.
struct Studio<'a> {
    renderer: Renderer<'a>,
    world: &'a LightWorld,
    ids: &'a [LightId],
}

/// Calls `test` with a renderer of pictures of 64 x 48 pixels of a scene.
fn with_studio(scene: &Scene, world: &LightWorld, test: impl Fn(&Studio<'_>)) {
    let geometry = Geometry::new(scene).expect("a sound scene");
    let view = View::new(scene, &geometry, (64, 48));
    let ids: Vec<LightId> = world.sampler().all_lights().collect();
    test(&Studio { renderer: Renderer { scene, geometry: &geometry, view: &view, numbers }, world, ids: &ids });
}

impl Studio<'_> {
    /// Calls `test` with the samplers flux, pbrt opaque and girandole.
    fn with_samplers(&self, test: impl Fn(&mut [(&str, &mut dyn Draw)])) {
        let lights = self.world.sampler();
        let published = samplers::published(&lights::carried(self.world), self.ids).expect("sound lights");
        let mut choosers: Vec<Chooser<'_>> = vec![samplers::two_level(self.world)];
        choosers.extend(published.into_iter().filter(|chooser| ["flux", "pbrt opaque"].contains(&chooser.name())));
        choosers.rotate_left(1);
        let mut draws: Vec<Single<'_>> =
            choosers.iter().map(|chooser| Single { chooser, lights, has_gloss: false }).collect();
        let named = choosers.iter().zip(&mut draws);
        let mut named: Vec<(&str, &mut dyn Draw)> =
            named.map(|(chooser, draw)| (chooser.name(), draw as &mut dyn Draw)).collect();
        test(&mut named);
    }

    /// The mean of the pictures of a way to draw minus that of the reference, whose means are
    /// given, and the standard error of the difference, both relative to the reference. There are
    /// [`SEEDS`] independent pictures of each.
    fn difference(&self, draw: &mut dyn Draw, samples: f64, reference: &[f64]) -> (f64, f64) {
        compare(SEEDS_OF_DRAWS.map(|seed| mean(&self.renderer.picture(draw, samples, seed))), reference)
    }

    /// The means of pictures by all lights, which no sampler is part of.
    fn means_by_all(&self) -> Vec<f64> {
        let picture = |seed| converged::picture(&self.renderer, &self.world.sampler(), self.ids, seed);
        REFERENCE_SEEDS.map(|seed| mean(&picture(seed))).collect()
    }
}

/// The mean of some pictures minus that of others, and the standard error of the difference, both
/// relative to the others.
fn compare(means: impl Iterator<Item = f64>, reference: &[f64]) -> (f64, f64) {
    let differences: Vec<f64> = means.zip(reference).map(|(mean, reference)| mean - reference).collect();
    let count = f64::from(SEEDS);
    let level = reference.iter().sum::<f64>() / count;
    let mean = differences.iter().sum::<f64>() / count;
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean / level, (variance / count).sqrt() / level)
}

/// Pictures per mean.
const SEEDS: u32 = 24;
/// The seeds of pictures that are compared.
const SEEDS_OF_DRAWS: std::ops::Range<u32> = 0..SEEDS;
/// The seeds of references.
const REFERENCE_SEEDS: std::ops::Range<u32> = 100..100 + SEEDS;
/// Student's t for 23 degrees of freedom, which chance exceeds once in 10,000 tries, both sides
/// together. With twelve comparisons that is one false alarm in 800 choices of seeds, and the seeds
/// are fixed.
const T_LIMIT: f64 = 4.69;

#[test]
fn the_pictures_of_all_ways_to_draw_have_the_mean_of_the_sum_over_all_lights() {
    let stage = prepare(small_scene::stage(true).expect("the small scene is sound"), 0.0).expect("a still scene");
    let Stage { scene, world, .. } = &stage;
    with_studio(scene, world, |studio| {
        let lights = world.sampler();
        let reference = studio.means_by_all();
        let check = |name: &str, draw: &mut dyn Draw, samples: f64| {
            let (difference, error) = studio.difference(draw, samples, &reference);
            assert!(difference.abs() <= T_LIMIT * error, "{name}: off by {difference}, standard error {error}");
            // Wide intervals would pass anything.
            assert!(error < 0.01, "{name}: standard error {error}");
        };
        studio.with_samplers(|samplers| {
            for ((name, draw), samples) in samplers.iter_mut().zip([20.0, 24.0, 6.0]) {
                check(name, *draw, samples);
            }
        });
        // With one shadow ray to every light.
        let pixels = 0..studio.renderer.view.pixels.len();
        let all = |seed| {
            let pixel = |index| studio.renderer.pixel_by_all(&lights, studio.ids, index, (8, seed));
            mean(&pixels.clone().map(pixel).collect::<Vec<_>>())
        };
        let (difference, error) = compare(SEEDS_OF_DRAWS.map(all), &reference);
        assert!(difference.abs() <= T_LIMIT * error && error < 0.01, "all lights: {difference}, {error}");
        check("resampled", &mut Resampled { lights, candidates: 4, has_gloss: false }, 8.0);
    });
}

/// The samplers that prepare each frame, with samples per pixel. Pixels share what is prepared, so their
/// errors do not average out as those of independent samples do.
const PREPARED: [(&str, f64); 4] = [("regir", 3.0), ("presampled 8", 6.0), ("presampled 32", 4.0), ("nee-at", 4.0)];

#[test]
fn the_pictures_of_samplers_that_prepare_frames_have_the_mean_of_the_sum_over_all_lights() {
    assert!(PREPARED.iter().map(|(name, _)| *name).eq(rivals::NAMES));
    let stage = prepare(small_scene::stage(true).expect("the small scene is sound"), 0.0).expect("a still scene");
    let Stage { scene, world, .. } = &stage;
    with_studio(scene, world, |studio| {
        let reference = studio.means_by_all();
        let carried = lights::carried(world);
        for (name, samples) in PREPARED {
            let list = (world.sampler(), studio.ids, &carried[..]);
            let mut draw =
                rivals::by_name(name, list, (studio.renderer.view, studio.renderer.view)).expect("a name of the list");
            let (difference, error) = studio.difference(draw.as_mut(), samples, &reference);
            assert!(difference.abs() <= T_LIMIT * error, "{name}: off by {difference}, standard error {error}");
            // Wide intervals would pass anything.
            assert!(error < 0.02, "{name}: standard error {error}");
        }
    });
}

/// Samples per pixel of the three samplers that take about the same time in the city.
const EQUAL_TIME: [f64; 3] = [6.0, 2.4, 2.0];

#[test]
fn girandole_has_the_least_error_in_the_city() {
    let city =
        procedural::stage(&CityOptions { size: Size::S, cars: None, seed: 1, lamp_profile: None }).expect("a city");
    let Stage { mut scene, world, .. } = prepare(city, 0.0).expect("a city moves");
    scene.materials.iter_mut().for_each(|material| (material.roughness, material.metallic) = (1.0, 0.0));
    with_studio(&scene, &world, |studio| {
        studio.with_samplers(|samplers| {
            let girandole = &mut *samplers[2].1;
            let reference: Vec<f64> =
                REFERENCE_SEEDS.map(|seed| mean(&studio.renderer.picture(girandole, 4.0, seed))).collect();
            let converged = studio.renderer.picture(girandole, 64.0, 1_000);
            let (difference, error) = studio.difference(samplers[1].1, 2.4, &reference);
            assert!(difference.abs() <= T_LIMIT * error, "off by {difference}, standard error {error}");
            assert!(error < 0.02, "standard error {error}");
            let score = |which: usize| {
                Score::new(&studio.renderer.picture(samplers[which].1, EQUAL_TIME[which], 0), &converged)
            };
            let [flux, pbrt, girandole] = [0, 1, 2].map(score);
            let all = format!("{flux:?} {pbrt:?} {girandole:?}");
            assert!(girandole.mape < 0.7 * pbrt.mape && girandole.mape < 0.7 * flux.mape, "{all}");
            assert!(girandole.rel_mse < 0.3 * pbrt.rel_mse && girandole.rel_mse < 0.3 * flux.rel_mse, "{all}");
        });
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
    let estimate = Estimate::new(&[1.0, 2.0, 3.0, 2.0]);
    // The variance is 2/3, its standard error sqrt(2/3/4).
    assert!(near(estimate.mean, 2.0) && near(estimate.half_width, 3.182 / 6.0_f64.sqrt()), "{estimate:?}");
    assert_eq!(Estimate::new(&[1.0]), Estimate { mean: 1.0, half_width: f64::INFINITY });
}

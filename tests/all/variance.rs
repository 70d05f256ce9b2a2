//! The measure of the variance example, and the published samplers that it compares with.

use girandole::{Light, LightId, LightTree, LightWorld, Placement, Policy, ShadingPoint, Shape};
use testbed::measuring::baselines::{BinaryTree, Cycles, Formula, Pbrt};
use testbed::measuring::lights::{carried, contributions};
use testbed::measuring::sigma::{Noise, Summary};
use testbed::testing::support::Rng;

/// The share of a shading point's light by which one light may differ between both spaces, by
/// rounding near the horizon.
const CARRY_TOLERANCE: f32 = 1.0e-3;

/// Rounding of a sum of a few hundred probabilities, each a product of about ten f32 factors.
const SUM_TOLERANCE: f64 = 1.0e-4;

fn check_formula<F: Formula>(formula: F, lights: &[Light], rng: &mut Rng) {
    let world = in_place(lights.to_vec());
    let sampler = world.sampler();
    let ids: Vec<LightId> = sampler.all_lights().collect();
    let binary = BinaryTree::new(formula, lights.to_vec());
    for _ in 0..60 {
        let shading_point = ShadingPoint::surface(rng.position(12.0), rng.direction());
        let pmfs = binary.pmfs(&shading_point);
        let sum: f64 = pmfs.iter().map(|p| f64::from(*p)).sum();
        assert!(sum <= 1.0 + SUM_TOLERANCE, "{sum}");
        let noise = Noise::of(&contributions(&sampler, &ids, &shading_point), &pmfs);
        assert!(noise.is_none_or(|noise| noise.sigma.is_finite()), "{shading_point:?}");
        for _ in 0..60 {
            if let Some((light, pmf)) = binary.pick(&shading_point, f64::from(rng.unit())) {
                assert_eq!(pmf, pmfs[light as usize]);
            }
        }
    }
}

#[test]
fn published_samplers_reach_every_light_that_contributes_and_pick_by_their_pmfs() {
    let mut rng = Rng(41);
    for count in [1, 2, 3, 40, 300] {
        let lights = rng.lights(count, 10.0);
        check_formula(Pbrt { is_opaque: false }, &lights, &mut rng);
        check_formula(Pbrt { is_opaque: true }, &lights, &mut rng);
        check_formula(Cycles, &lights, &mut rng);
    }
}

/// A world with one instance, placed where its lights are.
fn in_place(lights: Vec<Light>) -> LightWorld {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(lights).expect("valid lights"));
    world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("a valid placement");
    world
}

#[test]
fn lights_transformed_out_of_their_instances_contribute_as_before() {
    let mut rng = Rng(43);
    let mut world = rng.world(3, 20, 6, 10.0);
    let directionals: Vec<_> = world.directionals().collect();
    directionals.into_iter().for_each(|key| world.remove_directional(key).expect("a live key"));
    let flat = carried(&world);
    let flat_world = in_place(flat.clone());
    let (sampler, flat_sampler) = (world.sampler(), flat_world.sampler());
    let ids: Vec<LightId> = sampler.all_lights().collect();
    let flat_ids: Vec<LightId> = flat_sampler.all_lights().collect();
    assert_eq!((ids.len(), flat_ids.len()), (flat.len(), flat.len()));
    for _ in 0..50 {
        let shading_point = ShadingPoint::surface(rng.position(10.0), rng.direction());
        let before = contributions(&sampler, &ids, &shading_point);
        let after = contributions(&flat_sampler, &flat_ids, &shading_point);
        let sum: f32 = before.iter().sum();
        // Spheres become ellipsoids in unevenly scaled instances; a transformed light stays a
        // sphere.
        for (light, (a, b)) in flat.iter().zip(before.iter().zip(after)) {
            let is_sphere = matches!(light.shape, Shape::Sphere { .. });
            assert!(is_sphere || (a - b).abs() <= CARRY_TOLERANCE * sum, "{light:?} {a} {b} of {sum}");
        }
    }
}

#[test]
fn picks_of_a_published_sampler_are_as_frequent_as_their_pmfs() {
    let mut rng = Rng(42);
    let binary = BinaryTree::new(Cycles, rng.lights(12, 10.0));
    let shading_point = ShadingPoint::volume(rng.position(10.0));
    let pmfs = binary.pmfs(&shading_point);
    let mut counts = [0_u32; 12];
    let draws = 40_000;
    for _ in 0..draws {
        let (light, _) = binary.pick(&shading_point, f64::from(rng.unit())).expect("a light");
        counts[light as usize] += 1;
    }
    for (count, p) in counts.iter().zip(pmfs) {
        // Five standard deviations: a false alarm in less than one of 100,000 runs.
        let (share, p) = (f64::from(*count) / f64::from(draws), f64::from(p));
        assert!((share - p).abs() <= 5.0 * (p * (1.0 - p) / f64::from(draws)).sqrt() + 1e-9, "{share} {p}");
    }
}

#[test]
fn sigma_has_values_computed_by_hand() {
    let noise = |contributions: &[f32], pmfs: &[f32]| Noise::of(contributions, pmfs);
    let sigma = |sigma: f64, has_unreached: bool| Some(Noise { sigma, has_unreached });
    // (1 / .5 + 9 / .5) / 16 - 1 = 0.25.
    assert_eq!(noise(&[1.0, 3.0], &[0.5, 0.5]), sigma(0.5, false));
    assert_eq!(noise(&[1.0, 3.0], &[0.25, 0.75]), sigma(0.0, false));
    assert_eq!(noise(&[1.0, 3.0], &[0.0, 1.0]), sigma(f64::INFINITY, true));
    assert_eq!(noise(&[1.0e-9, 1.0], &[0.0, 1.0]), sigma(0.0, true));
    assert_eq!(noise(&[1.0, 3.0], &[f32::NAN, 1.0]), sigma(f64::INFINITY, true));
    assert_eq!(noise(&[0.0, 0.0], &[0.5, 0.5]), None);
    let hundred: Vec<Noise> = (1..=100).map(|i| Noise { sigma: f64::from(i), has_unreached: i == 7 }).collect();
    // The mean of the squares from 1 to n is (n + 1) (2 n + 1) / 6.
    let rms = (101.0_f64 * 201.0 / 6.0).sqrt();
    let summary = Summary { mean: 50.5, median: 50.0, p95: 95.0, p999: 100.0, rms, unreached: 1 };
    assert_eq!(Summary::of(&hundred), summary);
}

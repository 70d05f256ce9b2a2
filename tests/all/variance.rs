//! The measure of the variance example, and the published samplers that it compares with.

use girandole::{Light, LightId, LightWorld, Policy, ShadingPoint};
use testbed::measuring::baselines::{BinaryTree, Cycles, Formula, Pbrt};
use testbed::measuring::lights::contributions;
use testbed::measuring::sigma::{Noise, Summary};
use testbed::testing::support::{Rng, world_of};

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
    let (world, ..) = world_of(lights, Policy::Static);
    world
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

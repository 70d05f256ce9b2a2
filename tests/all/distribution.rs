//! The probabilities of all lights in one pass are those that are computed one by one.

use girandole::glam::Vec3;
use girandole::{
    DirectionalLight, Light, LightSampler, LightTree, LightWorld, MAX_SPLITS, Placement, Policy, ShadingPoint,
};

use testbed::testing::support::{Rng, all_pmfs};

/// Rounding of products of up to two dozen ratios in another order: each step rounds by 6e-8 of the
/// probability.
const TOLERANCE: f32 = 1.0e-5;

/// Rounding of a sum of up to a few thousand probabilities.
const SUM_TOLERANCE: f64 = 1.0e-4;

/// Below this the floors that keep a probability from rounding to 0 may apply in another order.
const LEAST: f32 = 1.0e-28;

fn agree(one: f32, other: f32) -> bool {
    (one > 0.0) == (other > 0.0) && (one - other).abs() <= TOLERANCE * other + LEAST
}

/// Compares the probabilities of a world's lights; returns their sum.
fn compare(sampler: &LightSampler<'_>, shading_point: &ShadingPoint, pmfs: &mut Vec<f32>) -> f64 {
    sampler.distribution(shading_point, pmfs);
    let one_by_one = all_pmfs(sampler, shading_point);
    assert_eq!(pmfs.len(), one_by_one.len());
    for (pmf, (light, expected)) in pmfs.iter().zip(one_by_one) {
        assert!(agree(*pmf, expected), "{light:?} at {shading_point:?}: {pmf} and {expected}");
    }
    pmfs.iter().map(|p| f64::from(*p)).sum()
}

#[test]
fn the_distribution_of_a_world_is_the_pmf_of_each_light() {
    let mut rng = Rng(71);
    let mut pmfs = vec![f32::NAN; 3];
    let (mut most, mut lit) = (0.0_f64, 0);
    for round in 0..12 {
        // Sheared and mirrored instances of several trees, of which one has a single light and one
        // has none, and unused slots.
        let mut world = rng.varied_world(4, 10 + 25 * (round % 4), 5, 40.0);
        for lights in [0, 1] {
            let tree = world.add_tree(LightTree::new(rng.lights(lights, 4.0)).expect("random lights are valid"));
            world.add_instance(tree, rng.affine(40.0), Policy::Budgeted).expect("a valid placement");
        }
        let removed: Vec<_> = world.instances().step_by(7).collect();
        removed.into_iter().for_each(|key| world.remove_instance(key).expect("a live key"));
        // Dark lights have the probability 0.
        let tree = world.trees().next().expect("a tree");
        let dark = Light::point(Vec3::ONE, Vec3::ZERO);
        world.set_lights(tree, &[(0, dark), (3, dark)]).expect("lights of that tree");
        world.update(girandole::FrameBudget::UNLIMITED);
        for splits in 0..=MAX_SPLITS {
            for _ in 0..6 {
                let shading_point = rng.masked_point(60.0);
                let sum = compare(&world.sampler().with_splits(splits), &shading_point, &mut pmfs);
                assert!(sum <= 1.0 + SUM_TOLERANCE, "{sum}");
                most = most.max(sum);
                lit += usize::from(sum > 0.0);
            }
        }
    }
    assert!(lit > 500 && most > 1.0 - SUM_TOLERANCE, "{lit} {most}");
}

#[test]
fn the_distribution_of_a_tree_is_the_pmf_of_each_light_and_sums_to_one() {
    let mut rng = Rng(72);
    let mut pmfs = Vec::new();
    for count in [0, 1, 2, 9, 100, 3000] {
        // Point lights reach everything: no draw ends without a light.
        let lights = (0..count).map(|_| Light::point(rng.position(20.0), Vec3::splat(rng.unit() + 0.01))).collect();
        let tree = LightTree::new(lights).expect("valid lights");
        for splits in 0..=MAX_SPLITS {
            let shading_point = ShadingPoint::volume(rng.position(30.0));
            tree.distribution(&shading_point, splits, &mut pmfs);
            assert_eq!(pmfs.len(), count);
            for (light, pmf) in (0..).zip(&pmfs) {
                assert!(agree(*pmf, tree.pmf(&shading_point, light, splits)));
            }
            let sum: f64 = pmfs.iter().map(|p| f64::from(*p)).sum();
            assert!(count == 0 || (sum - 1.0).abs() < SUM_TOLERANCE, "{sum}");
        }
    }
}

#[test]
fn a_world_without_trees_has_the_distribution_of_its_directional_lights() {
    let mut world = LightWorld::new();
    let mut pmfs = vec![1.0];
    let shading_point = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
    assert_eq!(compare(&world.sampler(), &shading_point, &mut pmfs), 0.0);
    for illuminance in [1.0, 3.0] {
        let light = DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::splat(illuminance) };
        world.add_directional(light).expect("a valid light");
    }
    compare(&world.sampler(), &shading_point, &mut pmfs);
    assert!((pmfs[0] - 0.25).abs() < 1.0e-6 && (pmfs[1] - 0.75).abs() < 1.0e-6, "{pmfs:?}");
    // A surface that faces down is not lit, with a dark tree or without.
    let below = ShadingPoint::surface(Vec3::ZERO, Vec3::NEG_Y);
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::X, Vec3::ZERO)]).expect("a dark light"));
    world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("a valid placement");
    assert_eq!(compare(&world.sampler(), &below, &mut pmfs), 0.0);
    assert_eq!(pmfs.len(), 3);
}

//! All chances in one pass are those of the lights one by one.

use girandole::glam::Vec3;
use girandole::{
    DirectionalLight, Light, LightSampler, LightTree, LightWorld, MAX_SPLITS, Placement, Policy, ShadingPoint,
    SplitCount,
};

use crate::support::{Rng, all_chances};

/// Products of up to two dozen ratios, joined in another order: each step rounds by 6e-8 of the chance.
const TOLERANCE: f32 = 1.0e-5;

/// Of a sum of as many as a few thousand of them.
const SUM_TOLERANCE: f64 = 1.0e-4;

/// Chances that count as this at least: below it, floors that keep a chance from rounding to 0 may come in another order.
const LEAST: f32 = 1.0e-28;

fn agree(one: f32, other: f32) -> bool {
    (one > 0.0) == (other > 0.0) && (one - other).abs() <= TOLERANCE * other + LEAST
}

/// Compares a world's chances; returns their sum.
fn compare(sampler: &LightSampler<'_>, shading_point: &ShadingPoint, chances: &mut Vec<f32>) -> f64 {
    sampler.distribution(shading_point, chances);
    let one_by_one = all_chances(sampler, shading_point);
    assert_eq!(chances.len(), one_by_one.len());
    for (chance, (light, pmf)) in chances.iter().zip(one_by_one) {
        assert!(agree(*chance, pmf), "{light:?} at {shading_point:?}: {chance} and {pmf}");
    }
    chances.iter().map(|p| f64::from(*p)).sum()
}

#[test]
fn all_chances_of_a_world_are_those_of_its_lights() {
    let mut rng = Rng(71);
    let mut chances = vec![f32::NAN; 3];
    let (mut most, mut lit) = (0.0_f64, 0);
    for round in 0..12 {
        // Sheared and mirrored instances of several trees, one of a single light and one of none, and gaps among slots.
        let mut world = rng.world(4, 10 + 25 * (round % 4), 5, 40.0);
        for lights in [0, 1] {
            let tree = world.add_tree(rng.lights(lights, 4.0)).expect("random lights are valid");
            world.add_instance(tree, rng.affine(40.0), Policy::Budgeted).expect("a valid placement");
        }
        let removed: Vec<_> = world.instances().step_by(7).collect();
        removed.into_iter().for_each(|key| world.remove_instance(key).expect("a live key"));
        // Dark lights have no chance.
        let tree = world.trees().next().expect("a tree");
        let dark = Light::point(Vec3::ONE, Vec3::ZERO);
        world.set_lights(tree, &[(0, dark), (3, dark)]).expect("lights of that tree");
        world.update(girandole::FrameBudget::UNLIMITED);
        for splits in (0..=MAX_SPLITS).filter_map(|count| SplitCount::new(count).ok()) {
            for _ in 0..6 {
                let shading_point = rng.shading_point(60.0);
                let sum = compare(&world.sampler().with_splits(splits), &shading_point, &mut chances);
                assert!(sum <= 1.0 + SUM_TOLERANCE, "{sum}");
                most = most.max(sum);
                lit += usize::from(sum > 0.0);
            }
        }
    }
    assert!(lit > 600 && most > 1.0 - SUM_TOLERANCE, "{lit} {most}");
}

#[test]
fn all_chances_of_a_tree_are_those_of_its_lights_and_sum_to_one() {
    let mut rng = Rng(72);
    let mut chances = Vec::new();
    for count in [0, 1, 2, 9, 100, 3000] {
        // Points are dark nowhere: nothing ends without a light.
        let lights = (0..count).map(|_| Light::point(rng.place(20.0), Vec3::splat(rng.unit() + 0.01))).collect();
        let tree = LightTree::new(lights).expect("valid lights");
        for splits in (0..=MAX_SPLITS).filter_map(|count| SplitCount::new(count).ok()) {
            let shading_point = ShadingPoint::volume(rng.place(30.0));
            tree.distribution(&shading_point, splits, &mut chances);
            assert_eq!(chances.len(), count);
            for (light, chance) in (0..).zip(&chances) {
                assert!(agree(*chance, tree.pmf(&shading_point, light, splits)));
            }
            let sum: f64 = chances.iter().map(|p| f64::from(*p)).sum();
            assert!(count == 0 || (sum - 1.0).abs() < SUM_TOLERANCE, "{sum}");
        }
    }
}

#[test]
fn a_world_without_trees_has_the_chances_of_its_directional_lights() {
    let mut world = LightWorld::new();
    let mut chances = vec![1.0];
    let shading_point = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
    assert_eq!(compare(&world.sampler(), &shading_point, &mut chances), 0.0);
    for illuminance in [1.0, 3.0] {
        let light = DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::splat(illuminance) };
        world.add_directional(light).expect("a valid light");
    }
    compare(&world.sampler(), &shading_point, &mut chances);
    assert!((chances[0] - 0.25).abs() < 1.0e-6 && (chances[1] - 0.75).abs() < 1.0e-6, "{chances:?}");
    // From below nothing is lit, with a dark tree or without.
    let below = ShadingPoint::surface(Vec3::ZERO, Vec3::NEG_Y);
    let tree = world.add_tree(vec![Light::point(Vec3::X, Vec3::ZERO)]).expect("a dark light");
    world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("a valid placement");
    assert_eq!(compare(&world.sampler(), &below, &mut chances), 0.0);
    assert_eq!(chances.len(), 3);
}

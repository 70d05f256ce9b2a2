//! Trees keep their invariants through builds, refits, rebuilds and random edits.

mod attributes;
mod many_refits;
mod rebuild;
mod refit;

use girandole::glam::Vec3;
use girandole::{Light, LightTree, MAX_SPLITS, ShadingPoint, Shape};

use testbed::testing::support::Rng;

/// A tree that has passed the check.
fn checked(lights: Vec<Light>) -> LightTree {
    let tree = LightTree::new(lights).expect("the lights are valid");
    tree.check().expect("a fresh tree is sound");
    tree
}

/// Changes that apply a function to all lights of a tree.
fn changed(tree: &LightTree, change: impl FnMut(&Light) -> Light) -> Vec<(u32, Light)> {
    (0..).zip(tree.lights().iter().map(change)).collect()
}

/// A light after a translation.
fn moved(light: &Light, by: Vec3) -> Light {
    mapped(light, |p| p + by, |v| v)
}

/// A light with its positions and its vectors mapped.
fn mapped(light: &Light, position: impl Fn(Vec3) -> Vec3, vector: impl Fn(Vec3) -> Vec3) -> Light {
    let mut light = *light;
    match &mut light.shape {
        Shape::Point { position: p } => *p = position(*p),
        Shape::Spot { position: p, direction, .. } => {
            (*p, *direction) = (position(*p), vector(*direction).normalize());
        }
        Shape::Rectangle { center, half_u, half_v, .. } => {
            (*center, *half_u, *half_v) = (position(*center), vector(*half_u), vector(*half_v));
        }
        Shape::Triangle { vertices, .. } => *vertices = vertices.map(&position),
        Shape::Sphere { center, radius } => {
            (*center, *radius) = (position(*center), vector(Vec3::X * *radius).length());
        }
        &mut _ => unreachable!("this version has no others"),
    }
    light
}

#[test]
fn lights_at_one_point_in_a_line_and_in_a_plane_make_sound_trees() {
    let lamp = |position| Light::point(position, Vec3::ONE);
    checked((0..5000).map(|_| lamp(Vec3::splat(3.0))).collect());
    let street = checked((0..1000).map(|i| lamp(Vec3::new(i as f32 * 10.0, 0.0, 0.0))).collect());
    // The boxes of a street have no area. If every split cost zero, the first level would not
    // separate near lamps from far ones.
    let root = &street.nodes()[0];
    let longest = (0..root.count()).map(|slot| root.cluster(slot).aabb.extent().x).fold(0.0, f32::max);
    assert!(longest < 0.4 * 9990.0, "{longest}");
    checked((0..1000).map(|i| lamp(Vec3::new((i % 30) as f32, 0.0, (i / 30) as f32))).collect());
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
                let same = tree.pmf(&shading_point, light, splits);
                // Products of up to two dozen ratios in another order, each of which rounds by 6e-8.
                assert!(*pmf > 0.0 && same > 0.0 && (pmf - same).abs() <= 1.0e-5 * same, "{pmf} {same}");
            }
            let sum: f64 = pmfs.iter().map(|p| f64::from(*p)).sum();
            assert!(count == 0 || (sum - 1.0).abs() < 1.0e-4, "{sum}");
        }
    }
}

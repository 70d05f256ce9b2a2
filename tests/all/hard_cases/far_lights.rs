//! One light far from all others, although boxes and means of a node are bytes on one grid.

use super::*;
use testbed::measuring::lights::{carried, reflections};
use testbed::measuring::samplers::{noise, two_level};
use testbed::testing::support::place_tree;

/// The most by which sigma among near lamps may grow when a far light joins their tree, or one tree
/// of them. Measured: 1.25 in the tree, where the others move one node down, and 1.0 beside it.
const MOST_GROWTH: f64 = 1.3;

/// Where the far light is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Far {
    Nowhere,
    InTheTree,
    InAnInstance,
}

/// How the near lamps are cut into instances.
#[derive(Clone, Copy, Debug)]
enum Near {
    /// 4,096 lamps in one tree.
    Tree,
    /// 512 instances of eight lamps.
    Instances,
}

/// Sigma at shading points among 4,096 lamps within 100 m, which bring some 60 lux. The far light is
/// a sphere that covers a ten-thousandth of the hemisphere, and brings `lux`.
fn sigma(near: Near, far: Far, distance: f32, lux: f32) -> f64 {
    let mut rng = Rng(440);
    let lamp = |position: Vec3| Light::point(position, Vec3::splat(50.0));
    let at = Vec3::new(0.6, 0.64, 0.48) * distance;
    let mut world = LightWorld::new();
    let mut add = |lights: Vec<Light>, at: Vec3| {
        place_tree(&mut world, lights, Placement::at(at.as_dvec3()), Policy::Static);
    };
    let flat = |rng: &mut Rng, size: f32| rng.position(size) * Vec3::new(1.0, 0.05, 1.0);
    let sphere = |center: Vec3| Light::sphere(center, distance / 100.0, Vec3::splat(lux * 1.0e4 / PI));
    match near {
        Near::Tree => {
            let mut lights: Vec<Light> = (0..4096).map(|_| lamp(flat(&mut rng, 100.0))).collect();
            if far == Far::InTheTree {
                lights.push(sphere(at));
            }
            add(lights, Vec3::ZERO);
        }
        Near::Instances => {
            for i in 0..512 {
                let center = flat(&mut rng, 100.0);
                let mut lights: Vec<Light> = (0..8).map(|_| lamp(rng.position(1.0))).collect();
                if i == 0 && far == Far::InTheTree {
                    lights.push(sphere(at - center));
                }
                add(lights, center);
            }
        }
    }
    if far == Far::InAnInstance {
        add(vec![sphere(Vec3::ZERO)], at);
    }
    world.update(FrameBudget::UNLIMITED);
    let mut rng = Rng(441);
    let points: Vec<ShadingPoint> = (0..100)
        .map(|_| ShadingPoint::surface(flat(&mut rng, 80.0), (Vec3::Y + 0.5 * rng.direction()).normalize()))
        .collect();
    let lights = carried(&world);
    let lux: Vec<Vec<f32>> = points.iter().map(|point| reflections(&lights, point)).collect();
    let summary = noise(&two_level(&world), &points, &lux).0;
    assert_eq!(summary.unreached, 0);
    summary.mean
}

#[test]
fn one_far_light_costs_a_tree_little_accuracy() {
    let alone = sigma(Near::Tree, Far::Nowhere, 0.0, 0.0);
    for far in [Far::InTheTree, Far::InAnInstance] {
        for distance in [1.0e3, 1.0e6, 0.99e9] {
            for lux in [1.0e-6, 1.0, 60.0] {
                let found = sigma(Near::Tree, far, distance, lux);
                assert!(found < MOST_GROWTH * alone, "{far:?} {distance} m, {lux} lux: {found} {alone}");
            }
        }
    }
}

/// The top level does not set a far instance apart, so this is a limit of today and not a promise:
/// at 1,000 km sigma grows from 0.17 to 0.78, and at 10^9 m to 25. All lights are still reached.
#[test]
fn one_far_instance_among_many_costs_no_accuracy_up_to_a_kilometre() {
    let alone = sigma(Near::Instances, Far::Nowhere, 0.0, 0.0);
    for lux in [1.0e-6, 1.0, 60.0] {
        let found = sigma(Near::Instances, Far::InAnInstance, 1.0e3, lux);
        assert!(found < MOST_GROWTH * alone, "{lux} lux: {found} {alone}");
        let far = sigma(Near::Instances, Far::InAnInstance, 1.0e6, lux);
        assert!(far < 5.0 * alone, "{lux} lux: {far} {alone}");
    }
}

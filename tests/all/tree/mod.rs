//! Trees keep their invariants through builds, refits, rebuilds and random edits.

mod attributes;
mod many_refits;
mod rebuild;
mod refit;

use girandole::cluster::Cluster;
use girandole::glam::Vec3;
use girandole::tree::WIDTH;
use girandole::{Light, LightTree, Shape};

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
fn trees_of_every_small_size_are_sound() {
    let mut rng = Rng(1);
    for count in (0..70).chain([500, 4095, 4096, 5000]) {
        checked(rng.lights(count, 50.0));
    }
}

#[test]
fn a_build_does_not_depend_on_the_number_of_threads() {
    let lights = Rng(2).lights(20_000, 100.0);
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("the pool starts");
        pool.install(|| checked(lights.clone()))
    };
    assert_eq!(build(1).nodes(), build(4).nodes());
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
fn a_tree_holds_24_decades_of_flux() {
    let mut rng = Rng(5);
    let lights = (0..200).map(|i| {
        let exponent = -12.0 + 24.0 * i as f32 / 199.0;
        Light::point(rng.position(10.0), Vec3::splat(10.0_f32.powf(exponent)))
    });
    let tree = checked(lights.collect());
    let mut fluxes = tree.nodes().iter().flat_map(|node| (0..node.count()).map(|slot| node.cluster(slot).flux));
    assert!(fluxes.all(|flux| flux > 0.0 && flux.is_finite()));
}

#[test]
fn the_public_accessors_of_a_node_take_any_slot() {
    let tree = checked(Rng(7).lights(100, 10.0));
    for node in tree.nodes() {
        for slot in [node.count(), WIDTH, WIDTH + 1, usize::MAX] {
            assert_eq!((node.child(slot), node.cluster(slot)), (None, Cluster::EMPTY));
        }
    }
}

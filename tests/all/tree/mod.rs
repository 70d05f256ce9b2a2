//! Trees keep their promises through builds, refits, rebuilds and random edits.

mod attributes;
mod rebuild;
mod refit;

use girandole::glam::Vec3;
use girandole::{Light, LightTree, Shape};

use crate::support::Rng;

fn checked(lights: Vec<Light>) -> LightTree {
    let tree = LightTree::new(lights).expect("valid lights");
    tree.check().expect("a fresh tree is sound");
    tree
}

/// All lights of a tree, with their indices, as they become when `change` is done to each.
fn changed(tree: &LightTree, change: impl FnMut(&Light) -> Light) -> Vec<(u32, Light)> {
    (0..).zip(tree.lights().iter().map(change)).collect()
}

/// A light that was moved.
fn moved(light: &Light, by: Vec3) -> Light {
    mapped(light, |p| p + by, |v| v)
}

/// A light with its places and its directions mapped.
fn mapped(light: &Light, place: impl Fn(Vec3) -> Vec3, vector: impl Fn(Vec3) -> Vec3) -> Light {
    let mut light = *light;
    match &mut light.shape {
        Shape::Point { position } => *position = place(*position),
        Shape::Spot { position, direction, .. } => {
            (*position, *direction) = (place(*position), vector(*direction).normalize());
        }
        Shape::Rectangle { center, half_u, half_v, .. } => {
            (*center, *half_u, *half_v) = (place(*center), vector(*half_u), vector(*half_v));
        }
        Shape::Triangle { vertices, .. } => *vertices = vertices.map(&place),
        Shape::Sphere { center, radius } => {
            (*center, *radius) = (place(*center), vector(Vec3::X * *radius).length());
        }
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
fn a_tree_is_the_same_for_any_number_of_threads() {
    let lights = Rng(2).lights(20_000, 100.0);
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| checked(lights.clone()))
    };
    assert_eq!(build(1).nodes(), build(4).nodes());
}

#[test]
fn lights_at_one_point_in_a_line_and_in_a_plane_make_sound_trees() {
    let lamp = |position| Light::point(position, Vec3::ONE);
    checked((0..5000).map(|_| lamp(Vec3::splat(3.0))).collect());
    let street = checked((0..1000).map(|i| lamp(Vec3::new(i as f32 * 10.0, 0.0, 0.0))).collect());
    // A street has boxes without area; if every split cost zero, the first level would not tell near from far.
    let root = &street.nodes()[0];
    let longest = (0..root.count()).map(|slot| root.cluster(slot).aabb.extent().x).fold(0.0, f32::max);
    assert!(longest < 0.4 * 9990.0, "{longest}");
    checked((0..1000).map(|i| lamp(Vec3::new((i % 30) as f32, 0.0, (i / 30) as f32))).collect());
}

#[test]
fn twelve_decades_of_flux_live_in_one_tree() {
    let mut rng = Rng(5);
    let lights = (0..200).map(|i| {
        let exponent = -12.0 + 24.0 * i as f32 / 199.0;
        Light::point(rng.place(10.0), Vec3::splat(10.0_f32.powf(exponent)))
    });
    let tree = checked(lights.collect());
    let fluxes = tree.nodes().iter().flat_map(|node| (0..node.count()).map(|slot| node.cluster(slot).flux));
    assert!(fluxes.into_iter().all(|flux| flux > 0.0 && flux.is_finite()));
}

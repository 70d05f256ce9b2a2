//! Stepped builds give the same trees as builds at once, in steps of bounded work.

use glam::Vec3;

use super::*;
use crate::tree::testing::{Rng, state_of};

/// Distributions of lights.
#[derive(Clone, Copy, Debug)]
enum Scene {
    Random,
    OnePoint,
    Dark,
    Collinear,
    TwoClusters,
    Geometric,
}

const SCENES: [Scene; 6] =
    [Scene::Random, Scene::OnePoint, Scene::Dark, Scene::Collinear, Scene::TwoClusters, Scene::Geometric];

fn light(rng: &mut Rng, scene: Scene, i: usize, count: usize) -> Light {
    let place = match scene {
        Scene::Random | Scene::Dark => rng.position(100.0),
        Scene::OnePoint => Vec3::splat(7.0),
        Scene::Collinear => Vec3::X * rng.between(-500.0, 500.0),
        Scene::TwoClusters => Vec3::X * [-1.0e6, 1.0e6][i % 2] + rng.position(1.0),
        Scene::Geometric => Vec3::new(1.0, 0.0, 1.0) * 10.0_f32.powf(-9.0 + 18.0 * i as f32 / count as f32),
    };
    let emission = match scene {
        Scene::Dark => Vec3::ZERO,
        _ => Vec3::splat(rng.between(0.0, 5.0)),
    };
    match i % 3 {
        0 => Light::point(place, emission).with_range(9.0 + i as f32),
        1 => Light::spot(place, rng.position(1.0).normalize(), 0.2, 0.9, emission),
        _ => Light::rectangle(place, Vec3::X * rng.between(0.1, 1.0), Vec3::Y * rng.between(0.1, 1.0), emission),
    }
}

fn lights(scene: Scene, count: usize) -> Vec<Light> {
    let mut rng = Rng(count as u64);
    (0..count).map(|i| light(&mut rng, scene, i, count)).collect()
}

/// Builds a tree in steps. Returns it and the sum of all units. Checks each step.
fn built(lights: &[Light], mut max_units: impl FnMut() -> usize) -> (LightTree, usize) {
    let mut build = TreeBuild::new(lights.len(), None);
    let mut sum = 0;
    while !build.is_done() {
        assert!(build.units_left() > 0);
        let max_units = max_units();
        let ticks = build.ticks;
        // The lights are not read once all of them have been copied.
        let units = build.step(if build.has_all_lights() { &[] } else { lights }, max_units);
        assert!(build.ticks > ticks, "the step made no progress");
        assert!(units <= max_units.saturating_add(MAX_EXTRA_UNITS), "{units} units of {max_units}: {build:?}");
        assert!(units >= max_units || build.is_done());
        sum += units;
    }
    assert_eq!((build.units_left(), build.step(&[], 100)), (0, 0));
    assert!(build.has_all_lights());
    (build.finish(), sum)
}

fn assert_same(tree: &LightTree, expected: &LightTree, name: impl Fn() -> String) {
    assert!(tree.lights == expected.lights && state_of(tree) == state_of(expected), "{}", name());
    let of_lights = |tree: &LightTree| size_of::<Light>() * tree.lights.capacity();
    let of_nodes = |tree: &LightTree| tree.memory_bytes() - of_lights(tree);
    assert_eq!(of_nodes(tree), of_nodes(expected), "{}", name());
}

#[test]
fn a_stepped_build_gives_the_same_bits_as_a_build_at_once_for_any_steps() {
    for scene in SCENES {
        for count in [0, 1, 2, 8, 9, 25, 64, 700, 5000] {
            let lights = lights(scene, count);
            let expected = LightTree::build(lights.clone());
            for max_units in [0, 1, 7, 100, 800, usize::MAX] {
                let tree = built(&lights, || max_units).0;
                assert_same(&tree, &expected, || format!("{scene:?}: {count} lights, {max_units} units"));
            }
            let mut rng = Rng(9);
            let tree = built(&lights, || (rng.bits() % 300) as usize).0;
            tree.check().unwrap_or_else(|e| panic!("{scene:?}: {count} lights: {e}"));
            assert_same(&tree, &expected, || format!("{scene:?}: {count} lights, random steps"));
        }
    }
}

#[test]
fn a_stepped_build_of_so_many_lights_that_sums_are_made_of_runs_gives_the_same_bits() {
    for (scene, max_units) in SCENES.into_iter().zip([1, 7, 800, 30, 100, usize::MAX]) {
        let lights = lights(scene, 70_000);
        let tree = built(&lights, || max_units).0;
        tree.check().unwrap_or_else(|e| panic!("{scene:?}: {e}"));
        assert_same(&tree, &LightTree::build(lights), || format!("{scene:?}"));
    }
}

#[test]
fn the_units_of_a_build_of_random_lights_are_its_lights_times_its_levels() {
    for count in [64, 100, 300, 1000, 5000, 20_000, 70_000] {
        let units = built(&lights(Scene::Random, count), || 500).1;
        let ratio = units as f64 / build_units(count) as f64;
        assert!((0.85..1.15).contains(&ratio), "{count} lights: {ratio}");
    }
    assert_eq!([0, 1, 2, 8, 1024].map(build_units), [0, 1, 4, 32, 11 * 1024]);
}

#[test]
fn the_units_that_are_left_fall_to_zero_and_agree_with_the_units_done() {
    for count in [64, 1000, 20_000] {
        let lights = lights(Scene::Random, count);
        let mut build = TreeBuild::new(count, None);
        let mut done = 0;
        let total = built(&lights, || 100).1;
        assert_eq!(build.units_left(), build_units(count));
        while !build.is_done() {
            let left = build.units_left();
            assert!((done + left).abs_diff(total) <= total * 3 / 20, "{done} done, {left} left of {total}: {build:?}");
            done += build.step(&lights, 100);
        }
    }
}

#[test]
fn each_light_has_the_value_that_it_had_when_it_was_copied() {
    let mut rng = Rng(4);
    let count = 3000;
    let mut present = lights(Scene::Random, count);
    let mut build = TreeBuild::new(count, None);
    let mut copied = Vec::new();
    while !build.has_all_lights() {
        let first = copied.len();
        build.step(&present, 50);
        copied.extend_from_slice(&present[first..build.tree.lights.len()]);
        for _ in 0..100 {
            let i = (rng.bits() % count as u64) as usize;
            present[i] = light(&mut rng, Scene::TwoClusters, i, count);
        }
    }
    assert!(copied != present && copied != lights(Scene::Random, count));
    while !build.is_done() {
        build.step(&[], 50);
    }
    assert_same(&build.finish(), &LightTree::build(copied), String::new);
}

#[test]
fn a_new_build_allocates_nothing_and_its_debug_text_is_short() {
    let build = TreeBuild::new(1_000_000, None);
    assert!(!build.has_all_lights() && !build.is_done());
    assert_eq!((build.tree.memory_bytes(), build.placed.capacity(), build.items.capacity()), (0, 0, 0));
    assert!(TreeBuild::new(0, None).has_all_lights() && TreeBuild::new(0, None).is_done());
    let text = format!("{build:?}");
    assert!(text.contains("lights: 1000000") && text.len() < 200, "{text}");
    fn is_send<T: Send>(_: &T) {}
    is_send(&build);
}

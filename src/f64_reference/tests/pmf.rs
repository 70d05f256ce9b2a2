//! Probabilities of all lights of trees and worlds.

use glam::{DVec3, Mat3, Vec3};

use super::{direction, exact, light, segment, shading_point, size, turn, view};
use crate::f64_reference::ROUNDING;
use crate::keys::LightId;
use crate::keys::slot_of;
use crate::light::luminance;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::ChildRef;
use crate::tree::testing::Rng;
use crate::{DirectionalLight, LightTree, LightWorld, Placement, Policy};
use testbed::measuring::reference::choice::{Distribution, Tree, distribution};
use testbed::measuring::reference::place::Map;

/// Numbers of splits: none, the default, and the most.
const SPLITS: [usize; 3] = [0, 6, 7];

/// The comparison of many distributions.
#[derive(Debug, Default)]
struct Comparison {
    points: usize,
    close: usize,
    /// The largest relative error.
    worst: f64,
    /// The largest relative error over the conditions along the path, in roundings.
    worst_per_condition: f64,
    errors: Vec<f64>,
}

impl Comparison {
    /// Checks the bounds. At most one of `close_each` shading points may have a decision that rounding
    /// may turn. Measured: 3.4 roundings per condition, 8e-4 and 1.2e-4.
    fn check(mut self, close_each: usize) {
        self.errors.sort_by(f64::total_cmp);
        let most_of_them = self.errors[self.errors.len() * 999 / 1000];
        let Self { points, close, worst, worst_per_condition, .. } = self;
        assert!(worst_per_condition < 8.0, "{worst_per_condition}");
        assert!(worst < 2.0e-3 && most_of_them < 2.0e-4, "{worst} {most_of_them}");
        assert!(self.errors.len() > 50_000 && close * close_each < points, "{} {close} {points}", self.errors.len());
    }

    fn add(&mut self, expected: &Distribution, pmf: impl Fn(Option<u32>, u32) -> f32) {
        self.points += 1;
        if expected.is_close {
            self.close += 1;
            return;
        }
        for (((instance, light), exact), condition) in expected.lights.iter().zip(&expected.conditions) {
            let ours = f64::from(pmf(*instance, *light));
            if *exact < 1.0e-25 {
                continue;
            }
            let error = (ours / exact - 1.0).abs();
            self.errors.push(error);
            self.worst = self.worst.max(error);
            self.worst_per_condition = self.worst_per_condition.max(error / condition / ROUNDING);
        }
    }
}

/// Compares the distributions of random trees.
fn compare_trees(seed: u64, shading_point: impl Fn(&mut Rng, f32) -> ShadingPoint) -> Comparison {
    let mut rng = Rng(seed);
    let mut all = Comparison::default();
    for _ in 0..20 {
        let scale = size(&mut rng, -3.0, 3.0);
        let lights = (0..200).map(|_| {
            let emission = size(&mut rng, -3.0, 3.0);
            light(&mut rng, scale, emission)
        });
        let tree = LightTree::new(lights.collect()).expect("valid");
        for round in 0..40 {
            let at = shading_point(&mut rng, 1.5 * scale);
            let splits = SPLITS[round % 3];
            let root = Tree { nodes: bytemuck::cast_slice(tree.nodes()), view: view(&at), instance: Some(0) };
            let expected = distribution(&root, splits, 0.0, &|_| None);
            all.add(&expected, |_, light| tree.pmf(&at, light, splits));
        }
    }
    all
}

#[test]
fn the_probabilities_of_a_tree_are_those_of_the_choice_in_f64() {
    compare_trees(520, shading_point).check(20);
}

#[test]
fn the_probabilities_of_a_tree_along_segments_are_those_of_the_choice_in_f64() {
    compare_trees(522, segment).check(20);
}

/// A world of instances of all kinds, with a moon.
fn world(rng: &mut Rng) -> LightWorld {
    let mut world = LightWorld::new();
    for _ in 0..4 {
        let count = 1 + rng.below(60);
        let lights = (0..count).map(|_| {
            let emission = size(rng, -3.0, 3.0);
            light(rng, 2.0, emission)
        });
        let tree = world.add_tree(LightTree::new(lights.collect()).expect("valid"));
        for i in 0..6 {
            let stretch = Vec3::new(size(rng, -0.5, 0.5), size(rng, -0.5, 0.5), size(rng, -0.5, 0.5));
            let linear = match i % 4 {
                0 | 1 => turn(rng),
                2 => turn(rng) * size(rng, -1.0, 1.0),
                _ => turn(rng) * Mat3::from_diagonal(stretch) * turn(rng),
            };
            let placement = Placement { linear, translation: exact(rng.position(20.0)) };
            let key = world.add_instance(tree, placement, Policy::Static).expect("valid");
            if i % 3 == 0 {
                world.set_appearance(key, |a| a.factor = Vec3::splat(size(rng, -2.0, 2.0))).expect("valid");
            }
        }
    }
    let moon = DirectionalLight { direction: direction(rng), illuminance: Vec3::splat(0.05) };
    world.add_directional(moon).expect("valid");
    world
}

/// Compares the distributions of random worlds.
fn compare_worlds(seed: u64, shading_point: impl Fn(&mut Rng, f32) -> ShadingPoint) -> Comparison {
    let mut rng = Rng(seed);
    let mut all = Comparison::default();
    for _ in 0..15 {
        let world = world(&mut rng);
        for round in 0..40 {
            let at = shading_point(&mut rng, 25.0);
            let splits = SPLITS[round % 3];
            let sampler = world.sampler().with_splits(splits);
            let top = world.top_level();
            let here = view(&at);
            let below = |leaf: u32| {
                let part = top.part(leaf)?;
                let key = world.instance_at(part.slot)?;
                let placement = world.instance(key)?.placement;
                let tree = world.tree(world.instance(key)?.tree)?;
                let brightness = f64::from(luminance(world.instance(key)?.appearance.factor));
                let view = here.in_tree(&Map::new(placement.linear.as_dmat3()), placement.translation, brightness);
                let target = match part.entry {
                    ChildRef::Node(index) => girandole::tree::ChildRef::Node(index),
                    ChildRef::Leaf(index) => girandole::tree::ChildRef::Leaf(index),
                };
                Some((Tree { nodes: bytemuck::cast_slice(tree.nodes()), view, instance: Some(part.slot) }, target))
            };
            let directional: f64 = world
                .directional_lights()
                .map(|(_, light)| {
                    let toward = -exact(light.direction).normalize();
                    let cosine = if at.normal == Vec3::ZERO { 1.0 } else { exact(at.normal).dot(toward).max(0.0) };
                    exact(light.illuminance).dot(DVec3::new(0.2126, 0.7152, 0.0722)) * cosine
                })
                .sum();
            let root = Tree { nodes: bytemuck::cast_slice(&top.nodes), view: here, instance: None };
            let expected = distribution(&root, splits, directional, &below);
            let pmf = |slot: Option<u32>, light| {
                let instance = world.instance_at(slot.expect("an instance")).expect("live");
                assert_eq!(Some(slot_of(instance)), slot);
                sampler.pmf(&at, LightId::Local { instance, light })
            };
            all.add(&expected, pmf);
        }
    }
    all
}

#[test]
fn the_probabilities_of_a_world_are_those_of_the_choice_in_f64() {
    compare_worlds(521, shading_point).check(20);
}

#[test]
fn the_probabilities_of_a_world_along_segments_are_those_of_the_choice_in_f64() {
    compare_worlds(523, segment).check(8);
}

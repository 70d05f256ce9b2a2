//! Baked trees come back bit for bit, and files that were damaged or forged are refused.

mod corruptions;
mod faults;
mod forgeries;
mod round_trips;

use glam::{Mat3, Quat, Vec3};

use super::Header;
use super::light_record::{Record, encode};
use crate::file::PREFIX_BYTES;
use crate::instance::placement::Placement;
use crate::light::{Light, Shape};
use crate::profile::tests::street_lamp;
use crate::tree::LightTree;
use crate::tree::testing::{Rng, State, state_of};

/// The bytes before the sides.
const HEADER_BYTES: usize = PREFIX_BYTES + size_of::<Header>();

/// A light of any shape, some of them dark, some with a range.
fn any_light(rng: &mut Rng) -> Light {
    let place = rng.position(30.0);
    let emission = Vec3::splat(rng.between(-0.2, 5.0).max(0.0));
    let (u, v) = (rng.position(0.5), rng.position(0.5));
    let direction = rng.position(1.0).normalize_or(Vec3::X);
    let light = match rng.below(7) {
        0 => Light::point(place, emission),
        1 => Light::spot(place, direction, 0.2, 0.9, emission),
        2 => Light::rectangle(place, u, v, emission),
        3 => Light::triangle([place, place + u, place + v], emission),
        4 => Light::triangle([place, place + u, place + v], emission).two_sided(),
        5 => Light::rectangle(place, u, v, emission).two_sided(),
        _ => Light::sphere(place, rng.between(0.0, 0.5), emission),
    };
    if rng.below(5) == 0 { light.with_range(rng.between(1.0, 90.0)) } else { light }
}

fn any_lights(rng: &mut Rng, count: usize) -> Vec<Light> {
    (0..count).map(|_| any_light(rng)).collect()
}

/// Trees of all kinds: of no light, of one node, divided into sides, deep, built for a stretched
/// instance, edited and degraded, with stale attributes, frozen.
fn trees() -> Vec<LightTree> {
    let mut rng = Rng(11);
    let mut trees: Vec<_> =
        [0, 1, 8, 9, 70, 257, 3000].into_iter().map(|count| LightTree::build(any_lights(&mut rng, count))).collect();
    assert!(trees.iter().any(|tree| !tree.sides().is_empty()) && trees.iter().any(|tree| tree.sides().is_empty()));
    let lamp = |light: Light, i: usize| match light.shape {
        Shape::Sphere { center, .. } => {
            Light::profile(center, Quat::from_rotation_x(i as f32), street_lamp(i as u64 % 3), light.emission)
        }
        _ => light,
    };
    let mixed = any_lights(&mut rng, 200).into_iter().enumerate().map(|(i, light)| lamp(light, i)).collect();
    trees.push(LightTree::build(mixed));
    let squashed = Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, 1.0, 0.01)), ..Placement::IDENTITY };
    let stretched = LightTree::new_for(any_lights(&mut rng, 300), squashed).expect("valid");
    assert!(stretched.reference().is_some());
    trees.push(stretched);
    let mut edited = LightTree::build(any_lights(&mut rng, 900));
    for refit in [LightTree::refit, LightTree::refit_without_attributes] {
        let changes: Vec<_> = (0..900).step_by(3).map(|index| (index, any_light(&mut rng))).collect();
        edited.apply(&changes);
        refit(&mut edited);
        trees.push(edited.clone());
    }
    edited.freeze();
    trees.push(edited);
    trees.push(LightTree::build((0..40).map(|i| Light::point(Vec3::X * i as f32, Vec3::ZERO)).collect()));
    // With vacant indices, and of them alone.
    let mut some = LightTree::build(any_lights(&mut rng, 700));
    some.remove_lights(&[0, 3, 4, 500, 699]).expect("it has the lights");
    some.rebuild();
    trees.push(some);
    let mut none = LightTree::build(any_lights(&mut rng, 3));
    none.remove_lights(&[0, 1, 2]).expect("it has the lights");
    trees.push(none);
    trees
}

/// The indices of the lights of a tree.
fn present(tree: &LightTree) -> Vec<u32> {
    (0..).zip(tree.lights()).filter(|(_, light)| !light.is_removed()).map(|(index, _)| index).collect()
}

/// The complete state of a tree.
fn whole_state(tree: &LightTree) -> (State, Vec<Record>, String) {
    let lights = tree.lights().iter().map(encode).collect();
    (state_of(tree), lights, format!("{:?}", tree.reference()))
}

/// The tree as its bytes keep it.
fn frozen(tree: &LightTree) -> LightTree {
    let mut tree = tree.clone();
    tree.freeze();
    tree
}

//! The lights of one town, cut into trees in several ways. A sampler should not notice.

use super::scene::{Make, Parts, in_box, lamp};
use crate::common::pcg::Rng;
use girandole::Light;
use girandole::glam::{Mat3, Vec3, vec3};

/// The scenes of the town, all of them with the same lights and the same shading points.
pub const TOWN: [&str; 8] = [
    "town, one tree",
    "town, a tree per block",
    "town, a tree per house and per lamp",
    "town, one tree of lamps above the houses",
    "town, 16 regions that overlap",
    "town, 16 random subsets",
    "town, 200 random subsets",
    "town, half as one tree and half as houses",
];

pub const SCENES: &[(&str, Make)] = &[
    (TOWN[0], |parts, _| town(parts, |_, _| 0)),
    (TOWN[1], |parts, _| town(parts, |_, light| light.block())),
    (TOWN[2], |parts, _| town(parts, |_, light| light.house.unwrap_or(HOUSES + light.number))),
    (TOWN[3], |parts, _| town(parts, |_, light| light.house.unwrap_or(HOUSES))),
    (TOWN[4], |parts, _| town(parts, TownLight::region)),
    (TOWN[5], |parts, _| town(parts, |rng, _| rng.below(16))),
    (TOWN[6], |parts, _| town(parts, |rng, _| rng.below(200))),
    (TOWN[7], |parts, _| town(parts, |_, light| light.house.filter(|_| light.number % 2 == 0).unwrap_or(HOUSES))),
    ("four large trees over 1,000 small ones", large_over_small),
];

/// Half of the town's edge, in metres.
const HALF: f32 = 500.0;
/// Houses, in rows of [`ROW`].
const HOUSES: usize = ROW * ROW;
const ROW: usize = 20;
const LIGHTS_PER_HOUSE: usize = 12;
const LAMPS: usize = 2000;

/// A light of the town.
struct TownLight {
    light: Light,
    position: Vec3,
    /// The house that it is in; `None` for a street lamp.
    house: Option<usize>,
    number: usize,
}

impl TownLight {
    /// One of 100 squares.
    fn block(&self) -> usize {
        let at = |x: f32| ((x + HALF) / (2.0 * HALF) * 10.0).clamp(0.0, 9.0) as usize;
        at(self.position.x) * 10 + at(self.position.z)
    }

    /// One of 16 squares, at random one of those whose middle is nearer than the length of their
    /// edge.
    fn region(rng: &mut Rng, light: &Self) -> usize {
        let shift = in_box(rng, vec3(0.25, 0.0, 0.25) * HALF);
        let at = |x: f32| ((x + HALF) / (2.0 * HALF) * 4.0).clamp(0.0, 3.0) as usize;
        at(light.position.x + shift.x) * 4 + at(light.position.z + shift.z)
    }
}

/// The middle of a house on the ground.
fn house(number: usize) -> Vec3 {
    let at = |i: usize| ((i as f32 + 0.5) / ROW as f32 * 2.0 - 1.0) * HALF;
    vec3(at(number % ROW), 0.0, at(number / ROW))
}

/// 2,000 street lamps over a square kilometre, and 400 houses with twelve weaker lamps each.
fn town_lights(rng: &mut Rng) -> Vec<TownLight> {
    let mut lights = Vec::new();
    let mut add = |position: Vec3, candela: f32, house: Option<usize>| {
        lights.push(TownLight { light: lamp(position, candela), position, house, number: lights.len() });
    };
    for _ in 0..LAMPS {
        add(in_box(rng, vec3(HALF, 0.0, HALF)) + Vec3::Y * rng.range(5.0, 8.0), rng.range(50.0, 200.0), None);
    }
    for number in 0..HOUSES {
        for _ in 0..LIGHTS_PER_HOUSE {
            let position = house(number) + in_box(rng, vec3(6.0, 3.0, 5.0)) + Vec3::Y * 3.5;
            add(position, rng.range(2.0, 20.0), Some(number));
        }
    }
    lights
}

/// The town with a tree for each number that `cut` gives to its lights.
fn town(parts: &mut Parts, cut: fn(&mut Rng, &TownLight) -> usize) {
    // The same for each cut.
    let (mut rng, mut cut_rng) = (Rng::new(78, 0), Rng::new(78, 1));
    let mut trees = std::collections::BTreeMap::<usize, Vec<Light>>::new();
    for light in town_lights(&mut rng) {
        trees.entry(cut(&mut cut_rng, &light)).or_default().push(light.light);
    }
    for lights in trees.into_values() {
        parts.add_here(lights);
    }
    parts.receive(|| match rng.chance(0.5) {
        true => (in_box(&mut rng, vec3(HALF, 0.0, HALF)), Vec3::Y),
        // A floor of a house.
        false => (house(rng.below(HOUSES)) + in_box(&mut rng, vec3(6.0, 0.0, 5.0)), Vec3::Y),
    });
}

/// Four trees of 1,000 lamps over the same 500 m, and 1,000 trees of six lamps within them.
fn large_over_small(parts: &mut Parts, rng: &mut Rng) {
    for _ in 0..4 {
        parts.add_here((0..1000).map(|_| lamp(in_box(rng, vec3(250.0, 5.0, 250.0)), rng.range(20.0, 200.0))).collect());
    }
    for _ in 0..1000 {
        let lights = (0..6).map(|_| lamp(in_box(rng, vec3(3.0, 2.0, 3.0)), rng.range(1.0, 10.0))).collect();
        parts.add(lights, Mat3::IDENTITY, in_box(rng, vec3(250.0, 3.0, 250.0)));
    }
    parts.receive(|| (in_box(rng, vec3(240.0, 0.0, 240.0)) - Vec3::Y * 6.0, Vec3::Y));
}

//! Scaled, deformed and overlapping instances.

use super::scene::{Make, Parts, direction, in_box, lamp, panel, rotation};
use crate::common::pcg::Rng;
use girandole::Light;
use girandole::glam::{Mat3, Vec3, vec3};
use std::f32::consts::PI;
use std::ops::Range;

pub const SCENES: &[(&str, Make)] = &[
    ("scaled by 0.01", |parts, rng| scaled(parts, rng, Vec3::splat(0.01))),
    ("scaled by 100", |parts, rng| scaled(parts, rng, Vec3::splat(100.0))),
    ("squashed along x by 0.01", |parts, rng| scaled(parts, rng, vec3(0.01, 1.0, 1.0))),
    ("stretched along x by 100", |parts, rng| scaled(parts, rng, vec3(100.0, 1.0, 1.0))),
    ("scales from 0.001 to 1", many_scales),
    ("200 overlapping instances", |parts, rng| overlapping(parts, rng, 200, 100)),
    ("1,000 overlapping instances", |parts, rng| overlapping(parts, rng, 1000, 20)),
    ("overlapping strings of lamps", overlapping_strings),
    ("sheared spots", sheared_spots),
    ("mirrored panels", mirrored_panels),
    ("stretched signs", stretched_signs),
    ("squashed by 0.9 over a turn", |parts, rng| squashed_over_a_turn(parts, rng, 0.9)),
    ("squashed by 0.5 over a turn", |parts, rng| squashed_over_a_turn(parts, rng, 0.5)),
    ("squashed by 0.1 over a turn", |parts, rng| squashed_over_a_turn(parts, rng, 0.1)),
    ("cars", cars),
];

/// Lamps and panels of a room 20 m wide in the world's space, whatever the scale.
fn lamps_and_panels(rng: &mut Rng, count: usize, half: Vec3, scale: Vec3) -> Vec<Light> {
    let one = |i: usize| {
        let (position, candela) = (in_box(rng, half) / scale, rng.range(5.0, 50.0));
        match i % 2 {
            0 => lamp(position, candela),
            // The world's panels have edges of 20 cm, wherever the scale is even.
            _ => {
                let size = 0.1 / scale.max_element();
                let normal = direction(rng);
                let u = normal.any_orthonormal_vector() * size;
                Light::rectangle(position, u, normal.cross(u), Vec3::splat(candela / 0.01))
            }
        }
    };
    (0..count).map(one).collect()
}

/// One tree of 2,000 lamps and panels in an instance that is scaled.
pub(super) fn scaled(parts: &mut Parts, rng: &mut Rng, scale: Vec3) {
    let half = vec3(10.0, 3.0, 10.0);
    parts.add(lamps_and_panels(rng, 2000, half, scale), Mat3::from_diagonal(scale), Vec3::ZERO);
    parts.receive(|| (in_box(rng, half), direction(rng)));
}

/// 200 instances of 100 such lights, each at a scale of its own.
fn many_scales(parts: &mut Parts, rng: &mut Rng) {
    for _ in 0..200 {
        let scale = 10.0_f32.powf(rng.range(-3.0, 0.0));
        let lights = lamps_and_panels(rng, 100, vec3(3.0, 1.0, 3.0), Vec3::splat(scale));
        parts.add(lights, rotation(rng) * scale, in_box(rng, vec3(40.0, 5.0, 40.0)));
    }
    parts.receive(|| (in_box(rng, vec3(40.0, 8.0, 40.0)), direction(rng)));
}

/// Instances of one tree of 100 such lights, whose panels have an edge of 20 cm at a scale of 1, at scales of
/// these powers of ten.
pub(super) fn shared_scales(parts: &mut Parts, rng: &mut Rng, instances: usize, powers: Range<f32>) {
    let lights = lamps_and_panels(rng, 100, vec3(3.0, 1.0, 3.0), Vec3::ONE);
    let places = (0..instances).map(|_| {
        let linear = rotation(rng) * 10.0_f32.powf(rng.range(powers.start, powers.end));
        (linear, in_box(rng, vec3(40.0, 5.0, 40.0)).as_dvec3())
    });
    parts.add_all(lights, places);
    parts.receive(|| (in_box(rng, vec3(40.0, 8.0, 40.0)), direction(rng)));
}

/// Instances whose lights all spread over the same square kilometre.
pub(super) fn overlapping(parts: &mut Parts, rng: &mut Rng, instances: usize, lights: usize) {
    for _ in 0..instances {
        let lights = (0..lights).map(|_| lamp(in_box(rng, vec3(500.0, 3.0, 500.0)), rng.range(20.0, 200.0))).collect();
        parts.add(lights, Mat3::from_rotation_y(rng.range(0.0, 2.0 * PI)), Vec3::ZERO);
    }
    parts.receive(|| (in_box(rng, vec3(300.0, 0.0, 300.0)) - Vec3::Y * 4.0, Vec3::Y));
}

/// Strings of 50 lamps across a square of 100 m, at all angles.
fn overlapping_strings(parts: &mut Parts, rng: &mut Rng) {
    for _ in 0..300 {
        let light = |i: usize| lamp(vec3(i as f32 - 25.0, 0.0, 0.0) * 2.0, 10.0);
        let turn = Mat3::from_rotation_y(rng.range(0.0, 2.0 * PI));
        parts.add((0..50).map(light).collect(), turn, in_box(rng, vec3(20.0, 2.0, 20.0)) + Vec3::Y * 5.0);
    }
    parts.receive(|| (in_box(rng, vec3(50.0, 0.0, 50.0)), Vec3::Y));
}

/// Spots in one sheared instance. The shading points are behind most of them.
fn sheared_spots(parts: &mut Parts, rng: &mut Rng) {
    let spot = |_| {
        let aim = (Vec3::Y + 0.6 * direction(rng)).normalize();
        Light::spot(in_box(rng, vec3(50.0, 1.0, 50.0)), aim, 0.2, rng.range(0.3, 1.2), Vec3::splat(100.0))
    };
    let shear = Mat3::from_cols(Vec3::X, vec3(0.05, 1.0, 0.0), Vec3::Z);
    parts.add((0..5000).map(spot).collect(), shear, Vec3::ZERO);
    parts.receive(|| {
        let side = vec3(rng.range(-60.0, 60.0), rng.range(-3.0, 6.0), rng.range(-60.0, 60.0));
        (side, direction(rng))
    });
}

/// 500 mirrored instances of a wall of 20 panels.
fn mirrored_panels(parts: &mut Parts, rng: &mut Rng) {
    let at = |i: usize| vec3((i % 5) as f32 - 2.0, (i / 5) as f32 + 0.5, 0.0);
    let wall: Vec<Light> = (0..20).map(|i| panel(at(i), Vec3::Z, 0.3, 20.0)).collect();
    for i in 0..500 {
        let mirror = if i % 2 == 0 { Vec3::ONE } else { vec3(1.0, 1.0, -1.0) };
        let turn = Mat3::from_rotation_y(rng.range(0.0, 2.0 * PI));
        let place = in_box(rng, vec3(150.0, 0.0, 150.0));
        parts.add(wall.clone(), turn * Mat3::from_diagonal(mirror), place);
    }
    parts.receive(|| (in_box(rng, vec3(120.0, 0.0, 120.0)), Vec3::Y));
}

/// 300 instances of one panel, which are stretched in its plane.
fn stretched_signs(parts: &mut Parts, rng: &mut Rng) {
    let places = (0..300).map(|_| {
        let linear = Mat3::from_rotation_y(rng.range(0.0, 2.0 * PI)) * Mat3::from_diagonal(vec3(5.0, 5.0, 1.0));
        (linear, (in_box(rng, vec3(100.0, 4.0, 100.0)) + Vec3::Y * 5.0).as_dvec3())
    });
    parts.add_all(vec![panel(Vec3::ZERO, Vec3::Z, 0.2, 20.0)], places);
    parts.receive(|| (in_box(rng, vec3(80.0, 0.0, 80.0)), Vec3::Y));
}

/// 2,000 lamps in an instance that is sheared: its scales are along axes over which its tree is turned.
fn squashed_over_a_turn(parts: &mut Parts, rng: &mut Rng, squash: f32) {
    let lamps = (0..2000).map(|_| lamp(in_box(rng, Vec3::splat(30.0)), 10.0)).collect();
    let turn = Mat3::from_axis_angle(vec3(1.0, 2.0, 3.0).normalize(), 1.0);
    parts.add(lamps, Mat3::from_diagonal(vec3(1.0, squash, 1.0)) * turn, Vec3::Y * 3.0);
    parts.receive(|| (in_box(rng, vec3(25.0, 0.0, 25.0)), Vec3::Y));
}

/// 2,000 cars on parallel streets, each with two beams forward and two panels back. Most of what a
/// car emits is turned away from any one shading point.
fn cars(parts: &mut Parts, rng: &mut Rng) {
    let side = |x: f32| {
        let beam = vec3(0.0, -0.08, 1.0).normalize();
        [
            Light::spot(vec3(x, 0.7, 2.0), beam, 0.15, 0.6, Vec3::splat(2000.0)),
            panel(vec3(x, 0.9, -2.0), Vec3::NEG_Z, 0.1, 4.0),
        ]
    };
    let car: Vec<Light> = [-0.7, 0.7].into_iter().flat_map(side).collect();
    let places = (0..2000).map(|_| {
        let street = (rng.below(12) as f32 - 5.5) * 60.0 + if rng.chance(0.5) { 2.0 } else { -2.0 };
        let along = rng.range(-300.0, 300.0);
        let is_crossing = rng.chance(0.5);
        let place = if is_crossing { vec3(along, 0.0, street) } else { vec3(street, 0.0, along) };
        let turn = if is_crossing { 0.5 * PI } else { 0.0 } + if rng.chance(0.5) { PI } else { 0.0 };
        (Mat3::from_rotation_y(turn), place.as_dvec3())
    });
    parts.add_all(car, places);
    parts.receive(|| {
        // The road and the walls beside it.
        let street = (rng.below(12) as f32 - 5.5) * 60.0;
        let along = rng.range(-250.0, 250.0);
        match rng.below(3) {
            0 => (vec3(street + rng.range(-6.0, 6.0), 0.0, along), Vec3::Y),
            1 => (vec3(street - 8.0, rng.range(0.0, 10.0), along), Vec3::X),
            _ => (vec3(along, rng.range(0.0, 10.0), street + 8.0), Vec3::NEG_Z),
        }
    });
}

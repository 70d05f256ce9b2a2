//! Scenes in which two levels were far worse than one tree, beside others of their kind: more trees
//! than a search for neighbours looked at, instances beyond a power of two of cells, many instances of
//! one large tree, an instance far away, small scales, and emitters at the shading point.
//!
//! They have few shading points and many lights, so they are measured against one tree alone.

use super::TortureScene;
use super::emitters::ball;
use super::instances::{overlapping as tens, scaled, shared_scales};
use super::scene::{Parts, direction, in_box, lamp};
use crate::common::pcg::Rng;
use girandole::ShadingPoint;
use girandole::glam::{DVec3, Mat3, Vec3, vec3};
use std::f32::consts::PI;
use std::f64::consts::TAU;

/// Shading points of each scene.
const SHADING_POINTS: usize = 32;

/// All scenes. They are the same in every run.
pub fn scenes() -> Vec<TortureScene> {
    let mut scenes = Vec::new();
    let mut add = |name: String, make: &dyn Fn(&mut Parts, &mut Rng)| {
        scenes.push(TortureScene::new(name, make, SHADING_POINTS));
    };
    for trees in [64, 65, 80, 128, 256] {
        add(format!("{trees} trees over one kilometre"), &|parts, _| trees_over(parts, trees));
    }
    for side in [256, 257, 300] {
        add(format!("{side} x {side} lamps"), &|parts, _| grid(parts, side));
    }
    for instances in [8, 30, 60, 200] {
        let name = format!("{instances} instances of 400 lamps over one kilometre");
        add(name, &|parts, rng| turned(parts, rng, instances));
    }
    for power in [3, 5, 6, 7, 9] {
        add(format!("a town, and a lamp 1e{power} m away"), &|parts, rng| far(parts, rng, 10.0_f64.powi(power)));
    }
    for (name, scale) in [
        ("scaled by 0.1", Vec3::splat(0.1)),
        ("scaled by 0.001", Vec3::splat(0.001)),
        ("squashed along z by 0.01", vec3(1.0, 1.0, 0.01)),
    ] {
        add(name.into(), &|parts, rng| scaled(parts, rng, scale));
    }
    add("one tree at scales from 0.01 to 1".into(), &|parts, rng| shared_scales(parts, rng, 200, -2.0..0.0));
    add("on a ball of triangles".into(), &on_ball);
    // Around 131,072 parts, and twice as many.
    for instances in [2100, 2250, 4060] {
        add(format!("{instances} overlapping instances of 64 lamps"), &|parts, _| overlapping(parts, instances));
    }
    for town in [40_000, 60_000, 120_000] {
        add(format!("a town of {town} lamps beside 4000"), &|parts, _| town_and_beside(parts, town, 4000));
    }
    for power in [4, 5, 6] {
        add(format!("30,000 lamps from 10 m to 1e{power} m"), &|parts, _| decades(parts, 30_000, power));
    }
    add("eight instances from 17 m to 1.4e8 m".into(), &|parts, _| eight(parts));
    add("lamps 9e8 m from the origin".into(), &|parts, rng| far_off(parts, rng, 9.0e8));
    for (name, decades) in [("1 to 100", 0.0..2.0), ("0.001 to 1000", -3.0..3.0)] {
        let name = format!("one tree at scales from {name}");
        add(name, &|parts, rng| shared_scales(parts, rng, 300, decades.clone()));
    }
    add("4,000 overlapping trees of ten lamps".into(), &|parts, rng| tens(parts, rng, 4000, 10));
    scenes
}

/// A term of Kronecker's sequence in three dimensions, in [0, 1).
fn lattice(n: usize) -> DVec3 {
    DVec3::from_array([0.819_172_5, 0.549_700_5, 0.671_043_6].map(|step| (0.5 + n as f64 * step).fract()))
}

/// Trees of 129 lamps, each over the same square kilometre.
fn trees_over(parts: &mut Parts, trees: usize) {
    let at = |n: usize| (lattice(n).with_y(0.005) * 1000.0 - DVec3::new(500.0, 0.0, 500.0)).as_vec3();
    for tree in 0..trees {
        parts.add_here((0..129).map(|i| lamp(at(129 * tree + i), 100.0)).collect());
    }
    let floor = |i: usize| vec3(lattice(i).x as f32 - 0.5, 0.0, lattice(i).z as f32 - 0.5) * 800.0;
    parts.shading_points = (0..SHADING_POINTS).map(|i| ShadingPoint::surface(floor(i), Vec3::Y)).collect();
}

/// A square of instances of one lamp, a metre apart. The shading points are along its last rows.
fn grid(parts: &mut Parts, side: usize) {
    let at = |i: usize| DVec3::new((i % side) as f64, 1.0, (i / side) as f64);
    parts.add_at(vec![lamp(Vec3::ZERO, 1.0)], (0..side * side).map(at));
    let last = |i: usize| {
        let DVec3 { x, z, .. } = lattice(i);
        DVec3::new(side as f64 - 3.0 + 4.0 * x, 0.0, (side as f64 - 1.0) * z).as_vec3()
    };
    parts.shading_points = (0..SHADING_POINTS).map(|i| ShadingPoint::surface(last(i), Vec3::Y)).collect();
}

/// Instances of one tree of 400 lamps over a square kilometre, each turned.
fn turned(parts: &mut Parts, rng: &mut Rng, instances: usize) {
    let lamps = (0..400).map(|_| lamp(in_box(rng, vec3(500.0, 1.0, 500.0)) + Vec3::Y * 5.0, 100.0)).collect();
    let turn = |_| (Mat3::from_rotation_y(rng.range(0.0, 2.0 * PI)), DVec3::ZERO);
    parts.add_all(lamps, (0..instances).map(turn));
    parts.receive(|| (in_box(rng, vec3(350.0, 0.0, 350.0)), Vec3::Y));
}

/// 4,096 instances of a lamp in one kilometre, and one more.
fn far(parts: &mut Parts, rng: &mut Rng, distance: f64) {
    let town = (0..4096).map(|_| (in_box(rng, vec3(500.0, 1.0, 500.0)) + Vec3::Y * 5.0).as_dvec3());
    parts.add_at(vec![lamp(Vec3::ZERO, 100.0)], town.chain([DVec3::X * distance]));
    parts.receive(|| (in_box(rng, vec3(500.0, 0.0, 500.0)), Vec3::Y));
}

/// Shading points a millimetre above a ball of triangles, with any normal.
fn on_ball(parts: &mut Parts, rng: &mut Rng) {
    parts.add_here(ball(Vec3::ZERO, 2.0, 50.0));
    parts.receive(|| (direction(rng) * 2.001, direction(rng)));
}

/// Adds instances of one lamp.
fn add_lamps(parts: &mut Parts, at: impl Iterator<Item = DVec3>) {
    parts.add_at(vec![lamp(Vec3::ZERO, 30.0)], at);
}

/// Adds shading points on a floor, within a rectangle.
fn add_floor(parts: &mut Parts, corner: Vec3, extent: Vec3) {
    let at = |i| corner + extent * lattice(i).as_vec3();
    parts.shading_points = (0..SHADING_POINTS).map(|i| ShadingPoint::surface(at(i), Vec3::Y)).collect();
}

/// Instances of one tree of 64 lamps over a square kilometre, each turned and moved a little.
fn overlapping(parts: &mut Parts, instances: usize) {
    let place = |i| (lattice(i) - DVec3::splat(0.5)) * 1000.0 * DVec3::new(1.0, 0.0, 1.0) + DVec3::Y * 4.0;
    let lamps = (0..64).map(|i| lamp(place(i).as_vec3(), 100.0)).collect();
    let turn = |i| Mat3::from_rotation_y(2.0 * PI * lattice(i).y as f32);
    parts.add_all(lamps, (0..instances).map(|i| (turn(i), lattice(i) * DVec3::new(40.0, 0.0, 40.0))));
    add_floor(parts, vec3(-400.0, 0.0, -400.0), vec3(800.0, 0.0, 800.0));
}

/// A dense town, and sparse lamps beside it.
fn town_and_beside(parts: &mut Parts, town: usize, beside: usize) {
    let town = (0..town).map(|i| DVec3::Y * 2.0 + lattice(i) * DVec3::new(500.0, 10.0, 570.0));
    let beside = (0..beside).map(|i| DVec3::new(-600.0 - 30.0 * (i % 20) as f64, 9.0, 30.0 * (i / 20) as f64));
    add_lamps(parts, town.chain(beside));
    add_floor(parts, vec3(10.0, 0.0, 10.0), vec3(480.0, 0.0, 550.0));
}

/// Lamps around the origin, from 10 m on, as many in each decade of distance.
fn decades(parts: &mut Parts, count: usize, power: i32) {
    let at = |i| {
        let place = lattice(i);
        let distance = 10.0_f64.powf(1.0 + f64::from(power - 1) * place.x);
        let (sine, cosine) = (TAU * place.z).sin_cos();
        DVec3::new(distance * cosine, 4.0 + 0.1 * distance * place.y, distance * sine)
    };
    add_lamps(parts, (0..count).map(at));
    add_floor(parts, vec3(-50.0, 0.0, -50.0), vec3(100.0, 0.0, 100.0));
}

/// As many instances as a node has children, of three lamps each. Half of them are near.
fn eight(parts: &mut Parts) {
    let at = |(i, distance): (usize, f64)| {
        let (sine, cosine) = (TAU * lattice(i).z).sin_cos();
        DVec3::new(cosine, 0.0, sine) * distance
    };
    let distances = [17.0, 19.0, 25.0, 30.0, 130.0, 4.5e4, 3.7e6, 1.4e8];
    let lamps = (0..3).map(|i| lamp(vec3(i as f32, 3.0, 0.0), 30.0)).collect();
    parts.add_at(lamps, distances.into_iter().enumerate().map(at));
    add_floor(parts, vec3(-5.0, 0.0, -5.0), vec3(10.0, 0.0, 10.0));
}

/// Lamps around a place far away from the origin, which does not follow it. Places there are as exact as f32 is.
fn far_off(parts: &mut Parts, rng: &mut Rng, distance: f64) {
    let extent = 5.0e-5 * distance as f32;
    let mut around = |height| DVec3::X * distance + in_box(rng, vec3(extent, height, extent)).as_dvec3();
    add_lamps(parts, (0..4096).map(|_| around(0.01 * extent)));
    parts.receive(|| (around(0.0).as_vec3() - Vec3::Y * 0.02 * extent, Vec3::Y));
}

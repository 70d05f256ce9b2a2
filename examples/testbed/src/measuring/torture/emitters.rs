//! Shading points on, in and near emitters.

use super::scene::{Make, Parts, direction, in_box, lamp, panel};
use crate::common::pcg::Rng;
use girandole::Light;
use girandole::glam::{Vec3, vec3};
use std::f32::consts::PI;

pub const SCENES: &[(&str, Make)] = &[
    ("on a glowing ball", on_glowing_ball),
    ("inside a sphere light", inside_sphere),
    ("before large panels", before_large_panels),
    ("touching windows", touching_windows),
    ("under a ceiling of panels", under_panels),
    ("two storeys", two_storeys),
    ("near weak lamps", near_weak_lamps),
    ("inside a shell of spheres", inside_shell),
];

/// The triangles of a sphere that is divided along meridians and circles of latitude.
pub(super) fn ball(center: Vec3, radius: f32, radiance: f32) -> Vec<Light> {
    let (rings, sectors) = (10, 34);
    let at = |ring: usize, sector: usize| {
        let (latitude, longitude) = (PI * ring as f32 / rings as f32, 2.0 * PI * sector as f32 / sectors as f32);
        center + radius * vec3(latitude.sin() * longitude.sin(), latitude.cos(), latitude.sin() * longitude.cos())
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for sector in 0..sectors {
            let [a, b] = [at(ring, sector), at(ring, sector + 1)];
            let [c, d] = [at(ring + 1, sector), at(ring + 1, sector + 1)];
            if ring > 0 {
                triangles.push(Light::triangle([a, d, b], Vec3::splat(radiance)));
            }
            if ring + 1 < rings {
                triangles.push(Light::triangle([a, c, d], Vec3::splat(radiance)));
            }
        }
    }
    triangles
}

/// Shading points on a ball of triangles, which are all below their horizon, among lamps.
fn on_glowing_ball(parts: &mut Parts, rng: &mut Rng) {
    parts.add_here(ball(Vec3::ZERO, 2.0, 50.0));
    parts.add_here((0..300).map(|_| lamp(direction(rng) * rng.range(5.0, 30.0), 20.0)).collect());
    parts.receive(|| {
        let normal = direction(rng);
        (normal * 2.001, normal)
    });
}

/// Shading points inside a sphere light, which emits outward only, among lamps.
fn inside_sphere(parts: &mut Parts, rng: &mut Rng) {
    let mut lights: Vec<Light> = (0..500).map(|_| lamp(in_box(rng, vec3(30.0, 10.0, 30.0)), 20.0)).collect();
    lights.push(Light::sphere(Vec3::ZERO, 3.0, Vec3::splat(100.0)));
    parts.add_here(lights);
    parts.receive(|| (direction(rng) * rng.range(0.0, 2.9), direction(rng)));
}

/// Shading points at 5 cm to 2 m from panels of 4 m among 1,000 lamps.
fn before_large_panels(parts: &mut Parts, rng: &mut Rng) {
    let places: Vec<(Vec3, Vec3)> = (0..20).map(|_| (in_box(rng, vec3(40.0, 5.0, 40.0)), direction(rng))).collect();
    let mut lights: Vec<Light> = places.iter().map(|(center, normal)| panel(*center, *normal, 2.0, 100.0)).collect();
    lights.extend((0..1000).map(|_| lamp(in_box(rng, vec3(40.0, 5.0, 40.0)), 10.0)));
    parts.add_here(lights);
    parts.receive(|| {
        let (center, normal) = rng.pick(&places);
        let beside = direction(rng).cross(normal) * rng.range(0.0, 2.5);
        let gap = 0.05 * 40.0_f32.powf(rng.unit());
        (center + beside + normal * gap, direction(rng))
    });
}

/// Shading points on façades between their lit windows, and facing other façades.
fn touching_windows(parts: &mut Parts, rng: &mut Rng) {
    for i in 0..40 {
        let (x, faces) = ((i / 2) as f32 * 40.0 - 400.0, i % 2 == 0);
        let (normal, place) = if faces { (Vec3::X, x) } else { (Vec3::NEG_X, x + 20.0) };
        let window = |k: usize| {
            let center = vec3(place, 1.5 + (k / 20) as f32 * 3.0, (k % 20) as f32 * 2.5 - 25.0);
            panel(center, normal, 0.6, rng.range(1.0, 60.0))
        };
        parts.add_here((0..200).map(window).collect());
    }
    parts.receive(|| {
        let (x, faces) = (rng.below(20) as f32 * 40.0 - 400.0, rng.chance(0.5));
        let (normal, place) = if faces { (Vec3::X, x) } else { (Vec3::NEG_X, x + 20.0) };
        (vec3(place, rng.range(0.0, 30.0), rng.range(-25.0, 25.0)) + normal * 1.0e-3, normal)
    });
}

/// A ceiling of 10,000 panels; shading points on the floor, close below the ceiling and on walls.
fn under_panels(parts: &mut Parts, rng: &mut Rng) {
    let at = |i: usize| vec3((i % 100) as f32 - 49.5, 3.0, (i / 100) as f32 - 49.5);
    parts.add_here((0..10_000).map(|i| panel(at(i), Vec3::NEG_Y, 0.4, 10.0)).collect());
    parts.receive(|| {
        let place = in_box(rng, vec3(45.0, 0.0, 45.0));
        match rng.below(3) {
            0 => (place, Vec3::Y),
            1 => (place + Vec3::Y * rng.range(2.5, 2.99), direction(rng)),
            _ => (place + Vec3::Y * rng.range(0.0, 3.0), Vec3::X),
        }
    });
}

/// Shading points on an upper floor: the lamps below are closer than those above.
fn two_storeys(parts: &mut Parts, rng: &mut Rng) {
    for floor in 0..4 {
        let ceiling = floor as f32 * 3.0 + 2.9;
        let lights = (0..500).map(|_| lamp(in_box(rng, vec3(25.0, 0.02, 25.0)) + Vec3::Y * ceiling, 20.0)).collect();
        parts.add_here(lights);
    }
    parts.receive(|| (in_box(rng, vec3(20.0, 0.0, 20.0)) + Vec3::Y * (3.0 * (1 + rng.below(3)) as f32), Vec3::Y));
}

/// Shading points 0.1 m to 2 m from weak lamps among strong ones.
fn near_weak_lamps(parts: &mut Parts, rng: &mut Rng) {
    let weak: Vec<Vec3> = (0..4000).map(|_| in_box(rng, vec3(80.0, 5.0, 80.0))).collect();
    let mut lights: Vec<Light> = weak.iter().map(|position| lamp(*position, 1.0)).collect();
    lights.extend((0..1000).map(|_| lamp(in_box(rng, vec3(80.0, 5.0, 80.0)), 100.0)));
    parts.add_here(lights);
    parts.receive(|| (rng.pick(&weak) + direction(rng) * 0.1 * 20.0_f32.powf(rng.unit()), direction(rng)));
}

/// Shading points inside a shell of sphere lights that nearly touch each other.
fn inside_shell(parts: &mut Parts, rng: &mut Rng) {
    let sphere = |_| Light::sphere(direction(rng) * 20.0, 0.5, Vec3::splat(rng.range(1.0, 30.0)));
    parts.add_here((0..2000).map(sphere).collect());
    parts.receive(|| (direction(rng) * 19.0 * rng.unit().cbrt(), direction(rng)));
}

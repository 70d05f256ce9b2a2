//! Glossy floors under many lamps.

use super::scene::{Make, Parts, TortureScene, in_box, lamp};
use crate::common::pcg::Rng;
use girandole::glam::{Vec3, vec3};
use girandole::{Gloss, Light, ShadingPoint};
use std::f32::consts::PI;

pub const SCENES: &[(&str, Make)] = &[("glossy floor", glossy_floor), ("metal floor", metal_floor)];

/// The eye that sees the floor.
const EYE: Vec3 = vec3(0.0, 1.7, 0.0);

/// A dark floor with a coat.
pub fn coated(roughness: f32) -> Gloss {
    Gloss { view: Vec3::ZERO, roughness, specular: 0.04, diffuse: 0.2 }
}

/// A floor of metal, which has no diffuse part.
pub fn metal(roughness: f32) -> Gloss {
    Gloss { view: Vec3::ZERO, roughness, specular: 0.7, diffuse: 0.0 }
}

/// The same scene with another floor. The views stay.
pub fn with_floor(scene: &TortureScene, floor: Gloss) -> Vec<ShadingPoint> {
    let seen = |at: &ShadingPoint| at.with_gloss(Gloss { view: EYE - at.position, ..floor });
    scene.shading_points.iter().map(seen).collect()
}

/// Lamps in rows under a ceiling, strings of lamps, spots, and lamps on the walls of a hall of 80
/// m.
fn hall(parts: &mut Parts, rng: &mut Rng) {
    let ceiling = |i: usize| vec3((i % 20) as f32 * 4.0 - 38.0, 8.0, (i / 20) as f32 * 4.0 - 38.0);
    parts.add_here((0..400).map(|i| lamp(ceiling(i), rng.range(5.0, 60.0))).collect());
    for _ in 0..20 {
        let (from, along) = (in_box(rng, vec3(30.0, 1.0, 30.0)) + Vec3::Y * 5.0, in_box(rng, vec3(10.0, 0.5, 10.0)));
        let bulb = |i: usize| {
            let share = i as f32 / 60.0;
            lamp(from + along * share - Vec3::Y * (PI * share).sin(), rng.range(0.3, 1.0))
        };
        parts.add_here((0..60).map(bulb).collect());
    }
    let spot = |_| {
        let place = in_box(rng, vec3(38.0, 0.5, 38.0)) + Vec3::Y * 7.0;
        let down = (Vec3::NEG_Y + in_box(rng, Vec3::splat(0.15))).normalize();
        Light::spot(place, down, 0.3, 0.6, Vec3::splat(rng.range(50.0, 400.0)))
    };
    parts.add_here((0..150).map(spot).collect());
    for wall in 0..4 {
        let (out, across) =
            [(Vec3::X, Vec3::Z), (Vec3::NEG_X, Vec3::Z), (Vec3::Z, Vec3::X), (Vec3::NEG_Z, Vec3::X)][wall];
        let sign = |_| {
            lamp(out * 40.0 + across * rng.range(-40.0, 40.0) + Vec3::Y * rng.range(0.5, 7.5), rng.range(0.5, 20.0))
        };
        parts.add_here((0..300).map(sign).collect());
    }
}

/// The floor of the hall from 1 to 35 m in front of the eye.
fn floor(parts: &mut Parts, rng: &mut Rng, gloss: Gloss) {
    parts.receive(|| {
        let (s, c) = rng.range(0.0, 2.0 * PI).sin_cos();
        (vec3(s, 0.0, c) * rng.range(1.0, 35.0), Vec3::Y)
    });
    for at in &mut parts.shading_points {
        *at = at.with_gloss(Gloss { view: EYE - at.position, ..gloss });
    }
}

fn glossy_floor(parts: &mut Parts, rng: &mut Rng) {
    hall(parts, rng);
    floor(parts, rng, coated(0.1));
}

fn metal_floor(parts: &mut Parts, rng: &mut Rng) {
    hall(parts, rng);
    floor(parts, rng, metal(0.2));
}

//! The fire as the CPU knows it: a basket of logs, and sparks where they are about.

use std::f32::consts::TAU;

use girandole::Light;
use girandole::glam::{Vec3, vec3};

use super::super::part::Part;
use super::super::rng::Rng;

/// Sparks, of which each is a light.
pub const SPARKS: u32 = 100_000;
/// Seconds of a step of the sparks.
pub const STEP: f32 = 1.0 / 24.0;
/// Sparks live from this many seconds up to so many; half of them live for less than 1.7 s, and on average
/// they live for 2.08 s, which is 50 steps.
pub const LIFE: [f32; 2] = [0.5, 5.24];
/// Height at which sparks are born, in metres, and the radius of the fire there.
pub const BIRTH: [f32; 2] = [0.75, 0.5];
/// No spark gets farther from the axis of the fire, nor higher, in metres.
pub const REACH: [f32; 2] = [8.0, 16.0];
/// Candela of an average spark when it is born, in the red channel.
pub const BRIGHTNESS: f32 = 0.14;
/// The share of the light of a spark that the camera sees of it: at the exposure for what sparks light, all of
/// it would be white.
pub const SHOWN: f32 = 0.015;

/// Sparks about where those of the kernel are, and about as bright.
pub fn lights() -> Vec<Light> {
    let mut rng = Rng::new(1, 0xf12e);
    let spark = |_| {
        let (age, angle) = (rng.unit().powi(2), TAU * rng.unit());
        let radius = (BIRTH[1] + 2.0 * age) * rng.unit().sqrt();
        let at = vec3(radius * angle.cos(), BIRTH[0] + 8.0 * age, radius * angle.sin());
        Light::point(at, vec3(0.5, 0.12, 0.01) * BRIGHTNESS)
    };
    (0..SPARKS).map(spark).collect()
}

/// An iron basket on a foot, with logs in it.
pub fn basket(steel: u32, wood: u32) -> Part {
    let mut part = Part::default();
    part.column(Vec3::ZERO, 0.3, [0.4, 0.15], 12, steel);
    part.column(Vec3::Y * 0.3, 0.3, [0.2, 0.62], 16, steel);
    for log in 0..7 {
        let (sin, cos) = (TAU / 7.0 * log as f32).sin_cos();
        let foot = vec3(0.42 * cos, 0.58, 0.42 * sin);
        part.beam(foot, vec3(-0.08 * cos, 0.98, 0.12 * sin), 0.05, wood);
    }
    part
}

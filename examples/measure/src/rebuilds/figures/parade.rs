//! A parade along a street and back: floats and people with lanterns, half of which go the other
//! way.

use super::figure::{Figure, size};
use girandole::glam::{Vec3, vec3};
use std::f32::consts::PI;
use testbed::scene::rng::Rng;

/// The radius of the bends at both ends, in metres.
const BEND: f32 = 1.6;

/// The lights of all floats and people.
pub struct Parade {
    /// The length of the straight part, in metres.
    length: f32,
    lights: Vec<Member>,
}

/// A light on a float, or a single lantern.
struct Member {
    /// The start of the float along the way, in metres.
    start: f32,
    /// Its distance from the middle of the way, in metres.
    beside: f32,
    /// Metres per second; backwards if negative.
    speed: f32,
    /// The position of the light on the float.
    offset: Vec3,
}

impl Parade {
    /// Floats with several lamps, and single lanterns.
    pub fn new(rng: &mut Rng) -> Self {
        let count = size(rng, 80.0, 700.0);
        let length = rng.range(20.0, 60.0);
        let speed = if rng.chance(0.3) { rng.range(0.05, 0.2) } else { rng.range(1.0, 3.0) };
        let on_floats = rng.range(0.2, 0.8);
        let lamps = 6 + rng.below(30);
        let mut lights = Vec::with_capacity(count);
        while lights.len() < count {
            let is_float = rng.chance(on_floats / lamps as f32 / (on_floats / lamps as f32 + 1.0 - on_floats));
            let start = rng.unit() * (2.0 * length + 2.0 * PI * BEND);
            let sign = if rng.chance(0.5) { 1.0 } else { -1.0 };
            let pace = speed * sign * rng.range(0.8, 1.2);
            // Each direction keeps to its own side.
            let beside = sign * 0.8 + rng.range(-0.4, 0.4);
            let members = if is_float { lamps.min(count - lights.len()) } else { 1 };
            for _ in 0..members {
                let half = if is_float { vec3(0.8, 1.3, 1.6) } else { vec3(0.1, 0.5, 0.1) };
                let offset = vec3(rng.range(-1.0, 1.0), rng.range(-1.0, 1.0), rng.range(-1.0, 1.0)) * half;
                lights.push(Member { start, beside, speed: pace, offset: offset + Vec3::Y * 2.0 });
            }
        }
        Self { length, lights }
    }
}

impl Figure for Parade {
    fn count(&self) -> usize {
        self.lights.len()
    }

    /// The way runs along Z, around a bend, back, and around another bend.
    fn place(&self, light: usize, time: f32) -> Vec3 {
        let Member { start, beside, speed, offset } = self.lights[light];
        let (length, bend) = (self.length, PI * BEND);
        let along = (start + speed * time).rem_euclid(2.0 * (length + bend));
        let (is_back, along) = if along < length + bend { (1.0, along) } else { (-1.0, along - length - bend) };
        let (x, z) = if along < length {
            (BEND + beside, along - 0.5 * length)
        } else {
            let angle = (along - length) / BEND;
            ((BEND + beside) * angle.cos(), 0.5 * length + (BEND + beside) * angle.sin())
        };
        vec3(x, 0.0, z) * is_back + offset
    }
}

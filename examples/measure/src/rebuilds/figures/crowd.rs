//! People with lanterns who stand in rows and then go their own ways.

use super::figure::{Figure, size};
use girandole::glam::{Vec2, Vec3, vec3};
use std::f32::consts::TAU;
use testbed::scene::rng::Rng;

/// The distance between people, in metres.
const STEP: f32 = 1.1;

/// People on a square.
pub struct Crowd {
    /// Half of the square's side, in metres.
    half: f32,
    starts: Vec<Vec3>,
    /// The velocities, in metres per second.
    ways: Vec<Vec2>,
}

impl Crowd {
    /// Starts in rows, in the middle of a square that is somewhat larger.
    pub fn new(rng: &mut Rng) -> Self {
        let count = size(rng, 60.0, 800.0);
        let side = (count as f32).sqrt().ceil() as usize;
        let half = 0.5 * STEP * side as f32;
        let starts = (0..count)
            .map(|i| vec3((i % side) as f32 * STEP - half, rng.range(1.2, 2.2), (i / side) as f32 * STEP - half))
            .collect();
        let speed = if rng.chance(0.2) { 0.05 } else { rng.range(1.5, 4.0) };
        let ways = (0..count).map(|_| Vec2::from_angle(rng.unit() * TAU) * (speed * rng.range(0.2, 1.4))).collect();
        Self { half: 1.3 * half + 2.0, starts, ways }
    }
}

/// Reflects a position at both ends of the range from `-half` to `half`.
fn turned_back(x: f32, half: f32) -> f32 {
    let along = (x + half).rem_euclid(4.0 * half);
    (if along > 2.0 * half { 4.0 * half - along } else { along }) - half
}

impl Figure for Crowd {
    fn count(&self) -> usize {
        self.starts.len()
    }

    fn place(&self, light: usize, time: f32) -> Vec3 {
        let (start, way) = (self.starts[light], self.ways[light]);
        let along = |start: f32, speed: f32| turned_back(start + speed * time, self.half);
        vec3(along(start.x, way.x), start.y, along(start.z, way.y))
    }
}

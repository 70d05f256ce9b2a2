//! A formation of drones that trade places.

use super::figure::{Figure, size};
use super::trade::Trade;
use girandole::glam::{Vec3, vec3};
use std::f32::consts::TAU;
use testbed::scene::rng::Rng;

/// The formation and its drift as a whole.
pub struct Swarm {
    trade: Trade,
    /// The reach of the drift, in metres.
    drift: f32,
}

impl Swarm {
    /// A globe, a helix, a disc or a wall, at random.
    pub fn new(rng: &mut Rng) -> Self {
        let count = size(rng, 100.0, 800.0);
        let radius = rng.range(0.8, 1.6) * (count as f32).powf(1.0 / 3.0) * 1.3;
        let shape = rng.below(4);
        let place = |drone: usize| {
            let along = (drone as f32 + 0.5) / count as f32;
            let turn = drone as f32 * 2.399_963;
            match shape {
                0 => {
                    let height = 1.0 - 2.0 * along;
                    let ring = (1.0 - height * height).sqrt();
                    vec3(ring * turn.cos(), height, ring * turn.sin()) * radius
                }
                1 => vec3((along * 5.0 * TAU).cos(), 3.0 * along - 1.5, (along * 5.0 * TAU).sin()) * radius,
                2 => vec3(turn.cos(), 0.1 * (3.0 * turn).sin(), turn.sin()) * (1.5 * radius * along.sqrt()),
                _ => {
                    let side = (count as f32).sqrt().ceil();
                    let (row, column) = ((drone as f32 / side).floor(), drone as f32 % side);
                    vec3(column / side - 0.5, row / side - 0.5, 0.0) * (3.0 * radius)
                }
            }
        };
        let places = (0..count).map(place).collect();
        let share = if rng.chance(0.3) { rng.range(0.02, 0.2) } else { rng.range(0.3, 1.0) };
        let duration = rng.range(1.2, 3.0);
        Self { trade: Trade::new(places, share, duration, rng), drift: rng.range(0.0, 2.0) }
    }
}

impl Figure for Swarm {
    fn count(&self) -> usize {
        self.trade.count()
    }

    fn place(&self, light: usize, time: f32) -> Vec3 {
        let drift = vec3((0.4 * time).sin(), 0.5 * (0.7 * time).sin(), (0.5 * time).cos());
        self.trade.place(light, time) + drift * self.drift
    }
}

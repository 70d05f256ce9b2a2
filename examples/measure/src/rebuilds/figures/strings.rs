//! Strings of bulbs that swing in the wind. They move all the time but hardly deform.

use super::figure::{Figure, size};
use girandole::glam::{Vec3, vec3};
use std::f32::consts::TAU;
use testbed::scene::rng::Rng;

/// Parallel strings, a few metres apart.
pub struct Strings {
    bulbs: usize,
    strings: usize,
    length: f32,
    sag: f32,
    sway: f32,
    phase: f32,
}

impl Strings {
    /// One to eight strings across a street or a yard.
    pub fn new(rng: &mut Rng) -> Self {
        let strings = 1 + rng.below(8);
        let bulbs = size(rng, 20.0, 60.0);
        Self {
            bulbs,
            strings,
            length: rng.range(14.0, 30.0),
            sag: rng.range(0.6, 2.0),
            sway: rng.range(0.1, 0.5),
            phase: rng.range(0.0, TAU),
        }
    }
}

impl Figure for Strings {
    fn count(&self) -> usize {
        self.bulbs * self.strings
    }

    fn place(&self, light: usize, time: f32) -> Vec3 {
        let (string, bulb) = (light / self.bulbs, light % self.bulbs);
        let t = (bulb as f32 + 0.5) / self.bulbs as f32;
        let slack = 4.0 * t * (1.0 - t);
        let phase = self.phase + string as f32 * 1.3;
        let wave = (time * 1.7 + phase + t * 2.5).sin() + 0.4 * (time * 4.1 + phase - t * 7.0).sin();
        let side = self.sway * slack * wave;
        let apart = (string as f32 - 0.5 * (self.strings - 1) as f32) * 5.0;
        vec3((t - 0.5) * self.length, 0.25 * side * side - self.sag * slack, apart + side)
    }
}

//! Random numbers for the unit tests of trees.

use glam::Vec3;

/// The generator of the integration tests.
#[path = "../../examples/common/split_mix.rs"]
mod split_mix;

/// SplitMix64: each test has its own fixed stream.
pub(crate) struct Rng(pub u64);

impl Rng {
    pub fn bits(&mut self) -> u64 {
        split_mix::next(&mut self.0)
    }

    /// In [0, 1), with 24 bits.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 * (1.0 / 16_777_216.0)
    }

    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// A position in the cube of half edge `size` about the origin.
    pub fn position(&mut self, size: f32) -> Vec3 {
        Vec3::new(self.between(-size, size), self.between(-size, size), self.between(-size, size))
    }
}

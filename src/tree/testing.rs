//! Random numbers for the unit tests of trees.

use glam::Vec3;

/// The generator of the integration tests.
#[path = "../../examples/common/split_mix.rs"]
mod split_mix;

pub(crate) use split_mix::Rng;

impl Rng {
    /// A position in the cube of half edge `size` about the origin.
    pub fn position(&mut self, size: f32) -> Vec3 {
        Vec3::new(self.between(-size, size), self.between(-size, size), self.between(-size, size))
    }
}

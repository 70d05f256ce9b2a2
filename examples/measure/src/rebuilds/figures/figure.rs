//! What all figures have in common.

use girandole::glam::Vec3;
use testbed::scene::rng::Rng;

/// Lights that move together.
pub trait Figure: Send + Sync {
    /// The number of lights.
    fn count(&self) -> usize;

    /// The position of a light after this many seconds, in the tree's own space.
    fn place(&self, light: usize, time: f32) -> Vec3;
}

/// A random number of lights between `least` and `most`, spread evenly over its logarithm. A few
/// figures get several times as many.
pub fn size(rng: &mut Rng, least: f32, most: f32) -> usize {
    let usual = least * (most / least).powf(rng.unit());
    let share = if rng.chance(0.03) { rng.range(3.0, 9.0) } else { 1.0 };
    (usual * share) as usize
}

//! What a renderer is asked for, and what it counts.

use girandole::FrameBudget;
use std::ops::Add;

/// How to render.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Samples a pixel: more is less noise, as its square root.
    pub spp: u32,
    /// Of the noise.
    pub seed: u64,
    /// What light trees may spend on rebuilds each frame.
    pub budget: FrameBudget,
    /// Frames a second of the world's time.
    pub fps: f64,
    /// The CPU backend can sum over all lights instead, for tests.
    pub light_choice: LightChoice,
}

/// How light reaches a surface point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightChoice {
    /// One light a sample, chosen through the light trees.
    #[default]
    Tree,
    #[cfg_attr(not(test), allow(dead_code, reason = "tests compare with it"))]
    /// Every light, each with one sample: slow, and what the trees must agree with.
    Exhaustive,
}

/// How many samples of lights asked what stands between.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShadowRays {
    /// Rays that were traced.
    pub traced: u64,
    /// Those that nothing could have stood in the way of.
    pub skipped: u64,
}

impl Add for ShadowRays {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { traced: self.traced + other.traced, skipped: self.skipped + other.skipped }
    }
}

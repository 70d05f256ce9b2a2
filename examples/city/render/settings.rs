//! How to render.

use girandole::CandidateCount;

/// Settings of a renderer.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Width of the picture in pixels.
    pub width: u32,
    /// Height of the picture in pixels.
    pub height: u32,
    /// Samples per pixel. The noise falls with its square root.
    pub spp: u32,
    /// Candidates of which each sample keeps one. More of them lower the noise of reflections and
    /// cost time, but no shadow rays.
    pub candidates: CandidateCount,
    /// Of the random numbers.
    pub seed: u64,
    /// How lights are sampled. The GPU backend always uses the light trees.
    pub light_choice: LightChoice,
}

/// How lights are sampled at a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightChoice {
    /// One light per sample, from the light trees.
    #[default]
    Tree,
    /// All lights in every sample: slow, for tests.
    #[cfg_attr(not(test), allow(dead_code, reason = "only tests use it"))]
    Exhaustive,
}

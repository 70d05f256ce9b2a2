//! How to render.

use super::scene::Scene;
use clap::ValueEnum;
use girandole::CutOptions;

/// The most candidates of a sample, as in shaders.
pub const MAX_CANDIDATES: u32 = 32;

/// Settings of a renderer.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Width of the picture in pixels.
    pub width: u32,
    /// Height of the picture in pixels.
    pub height: u32,
    /// Samples per pixel. The noise falls with its square root.
    pub spp: u32,
    /// Clusters that are split for each point before a light is chosen, on the CPU. More of them lower the noise and
    /// cost time.
    pub splits: usize,
    /// Candidates of which each sample keeps one. More of them lower the noise of reflections and
    /// cost time, but no shadow rays.
    pub candidates: u32,
    /// With one sample for each pixel on a GPU, the draws that the light a pixel keeps from the frame before stands for,
    /// at most; 0 to keep none: the pass of docs/reuse.md.
    pub reused_frames: u32,
    /// Of the random numbers.
    pub seed: u64,
    /// How lights are sampled. The CPU renders [`LightChoice::Exhaustive`], even if the backend is a GPU.
    pub light_choice: LightChoice,
}

/// How lights are sampled at a surface. The comments on the variants of `--sampler` are part of the
/// help text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum LightChoice {
    /// One light per sample, from the light trees; on a GPU from cuts that neighbouring points share
    #[default]
    Girandole,
    /// One light per sample, from cuts of the light trees that neighbouring points share
    SharedCuts,
    /// One light per sample, by walks from the roots of the light trees
    Roots,
    /// All lights in every sample, without a choice. The cost of a sample grows with their number.
    #[value(skip)]
    Exhaustive,
}

impl Settings {
    /// The draws that a kept light stands for, at most; 0 if no light is kept.
    pub fn reused(&self) -> u32 {
        let keeps = self.spp == 1 && self.light_choice != LightChoice::Exhaustive;
        if keeps { self.reused_frames } else { 0 }
    }
}

/// The cells of [`LightChoice::SharedCuts`]. Each pixel marks one of its samples.
pub fn cut_options(settings: &Settings) -> CutOptions {
    let options = CutOptions::default();
    options.with_min_marks(options.min_marks().div_ceil(settings.spp.max(1)))
}

/// The size of a pixel at a distance of one metre, in metres.
pub fn pixel_size(scene: &Scene, settings: &Settings) -> f32 {
    2.0 * (0.5 * scene.camera.vertical_fov).tan() / settings.height as f32
}

//! The command line, and how closely a run measures.

use super::{reuse, rivals, run};
use clap::Parser;
use std::path::PathBuf;
use testbed::scene::SceneError;
use testbed::scene_options::{SceneOptions, parse_size};

/// Shows what accuracy costs in time, by every setting of the library and by other samplers.
#[derive(Clone, Debug, Parser)]
pub struct Options {
    /// Folder for the page, the table, the plots and the reference; created if it does not exist
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    #[command(flatten)]
    pub scene: SceneOptions,
    /// Width and height of the picture in pixels [default: 256x144]
    #[arg(long, value_name = "WxH", value_parser = |text: &str| parse_size(text, 16..=4_096))]
    pub size: Option<(u32, u32)>,
    /// Pictures of each setting, which differ in their random numbers [default: 8]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1_000))]
    pub pictures: Option<u32>,
    /// Passes of the reference: four sums over all lights per pixel in each [default: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
    pub passes: Option<u32>,
    /// Make all materials diffuse. Lights are chosen without regard to the BRDF, so glossy surfaces
    /// are noisier
    #[arg(long)]
    pub matte: bool,
    /// Compare published samplers with the library in several scenes instead, and write rivals.csv. A glTF
    /// scene is one more of them
    #[arg(long, conflicts_with_all = ["world", "cars", "lamps", "passes"])]
    pub rivals: bool,
    /// Measure reservoirs that are kept over frames, with new samples by several samplers, in six scenes instead, and
    /// write reuse.csv
    #[arg(long, conflicts_with_all = ["rivals", "world", "cars", "lamps", "passes", "gltf", "size"])]
    pub reuse: bool,
    /// A tiny picture, few settings and a short reference, to try it out
    #[arg(long)]
    pub quick: bool,
}

/// Measures what the options ask for.
///
/// # Errors
/// For a scene that cannot be read and a folder that cannot be written.
pub fn run(options: &Options) -> Result<(), SceneError> {
    match options {
        Options { rivals: true, .. } => rivals::run(options),
        Options { reuse: true, .. } => reuse::run(options),
        _ => run::run(options).map(drop),
    }
}

/// How closely a run measures.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    pub size: (u32, u32),
    /// Pictures of each setting.
    pub pictures: u32,
    /// Passes of the reference.
    pub passes: u32,
    /// Shading points of the exact noise, at most.
    pub noise_points: usize,
    /// Draws for each of these points where the noise must be estimated.
    pub noise_draws: u32,
    /// Pixels whose samples are timed.
    pub timed_pixels: usize,
    /// Lights that a picture by all lights evaluates, at most. Such a picture shows only some of
    /// the pixels.
    pub most_evaluations: usize,
    /// Frames that the scene plays.
    pub frames: u32,
    /// Whether a few settings stand for all.
    pub is_quick: bool,
}

impl Options {
    /// The plan that these options ask for.
    pub fn plan(&self) -> Plan {
        let full = Plan {
            size: (256, 144),
            pictures: 8,
            passes: 2,
            noise_points: 200,
            noise_draws: 1_000,
            timed_pixels: 6_000,
            most_evaluations: 15_000_000,
            frames: 48,
            is_quick: false,
        };
        let quick = Plan {
            size: (48, 27),
            pictures: 3,
            passes: 2,
            noise_points: 10,
            noise_draws: 50,
            timed_pixels: 200,
            most_evaluations: 500_000,
            frames: 4,
            is_quick: true,
        };
        let plan = if self.quick { quick } else { full };
        Plan {
            size: self.size.unwrap_or(plan.size),
            pictures: self.pictures.unwrap_or(plan.pictures),
            passes: self.passes.unwrap_or(plan.passes),
            ..plan
        }
    }
}

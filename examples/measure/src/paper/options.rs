//! The command line, and the whole run.

use super::pictures::Settings;
use super::play::{Plan, play};
use super::stages::{Source, Timing};
use super::strategies::TreeKind;
use super::{plots, report, survey};
use clap::Parser;
use girandole::glam::Vec3;
use std::path::PathBuf;
use testbed::common::progress::progress;
use testbed::scene::SceneError;
use testbed::scene::procedural::Size;
use testbed::scene_options::{parse_camera, parse_size};

/// Repeats the experiment of Sosnowski and Szajerman on animated light trees.
#[derive(Clone, Debug, Parser)]
pub struct Options {
    /// The folder of the tables and plots
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// A small city, small pictures and few frames: seconds
    #[arg(long)]
    pub quick: bool,
    /// Play this glTF scene (.gltf or .glb), too
    #[arg(long, value_name = "FILE")]
    pub gltf: Option<PathBuf>,
    /// Leave the city out
    #[arg(long, requires = "gltf")]
    pub no_city: bool,
    /// Play only the library's trees, never rebuilt, always rebuilt and within budgets
    #[arg(long)]
    pub budgets: bool,
    /// Size of the city [default: M, or S with --quick]
    #[arg(long, value_name = "SIZE", value_enum, ignore_case = true)]
    pub world: Option<Size>,
    /// Camera in the glTF scene: position and target in metres
    #[arg(long, value_name = "x,y,z,x,y,z", value_parser = parse_camera, allow_hyphen_values = true, default_value = "-25,3,3,0,4,-4")]
    pub camera: (Vec3, Vec3),
    /// Line of the vehicles in the glTF scene: from and to, on the ground, in metres
    #[arg(long, value_name = "x,y,z,x,y,z", value_parser = parse_camera, allow_hyphen_values = true, default_value = "-38,-0.05,2,12,-0.05,2")]
    pub path: (Vec3, Vec3),
    /// Number of vehicles in the glTF scene
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u32).range(0..=1_000))]
    pub vehicles: u32,
    /// Number of frames [default: 44, or 8 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=10_000))]
    pub frames: Option<u32>,
    /// Frames per second of the animation; fewer move the lights further in each frame
    #[arg(long, value_name = "F", value_parser = parse_fps, allow_negative_numbers = true, default_value = "4")]
    pub fps: f64,
    /// Time of the first frame in the animation, in seconds; another start gives other trees
    #[arg(long, value_name = "S", value_parser = parse_start, allow_negative_numbers = true, default_value = "0")]
    pub start: f64,
    /// Number of independent pictures of each frame and strategy [default: 5, or 2 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1_000))]
    pub seeds: Option<u32>,
    /// Size of the pictures in pixels [default: 160x90, or 32x18 with --quick]
    #[arg(long, value_name = "WxH", value_parser = |text: &str| parse_size(text, 8..=MAX_SIZE))]
    pub size: Option<(u32, u32)>,
    /// Light samples per pixel
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=4_096))]
    pub samples: u32,
    /// Passes of 16 samples per pixel and 8 candidates each in a reference [default: 4, or 2 with
    /// --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1_000))]
    pub passes: Option<u32>,
}

/// The greatest width and height of a picture.
const MAX_SIZE: u32 = 4_096;

fn parse_fps(text: &str) -> Result<f64, String> {
    let fps = text.parse().ok().filter(|fps| (0.01..=1_000.0).contains(fps));
    fps.ok_or_else(|| "expected a number from 0.01 to 1000".into())
}

fn parse_start(text: &str) -> Result<f64, String> {
    let start = text.parse().ok().filter(|start| (0.0..=10_000.0).contains(start));
    start.ok_or_else(|| "expected a number from 0 to 10000".into())
}

/// Plays the scenes and writes all files. An error is one line for the user.
pub fn run(options: &Options) -> Result<(), SceneError> {
    let quick = |full: u32, quick: u32| if options.quick { quick } else { full };
    let plan = Plan {
        frames: options.frames.unwrap_or(quick(44, 8)),
        has_algorithms: !options.budgets,
        timing: Timing { start: options.start, fps: options.fps },
        settings: Settings {
            size: options.size.unwrap_or(if options.quick { (32, 18) } else { (160, 90) }),
            samples: options.samples,
            seeds: options.seeds.unwrap_or(quick(5, 2)),
            passes: options.passes.unwrap_or(quick(4, 2)),
        },
    };
    let city = options.world.unwrap_or(if options.quick { Size::S } else { Size::M });
    let mut sources = Vec::new();
    if !options.no_city {
        sources.push(Source::City(city));
    }
    if let Some(file) = &options.gltf {
        sources.push(Source::Gltf {
            file: file.clone(),
            camera: options.camera,
            path: options.path,
            vehicles: options.vehicles as usize,
        });
    }
    // Before a city plays for an hour, and before the tables of an earlier run are emptied.
    for file in sources.iter().filter(|source| matches!(source, Source::Gltf { .. })) {
        file.load(options.start)?;
    }
    let mut tables = report::Tables::create(&options.out)?;
    let threads = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let threads = threads.map_err(|error| SceneError(format!("cannot start a thread: {error}")))?;
    let steps = sources.len() as u64 * u64::from(plan.frames + survey::points(plan.frames));
    let progress = progress("", steps);
    for source in &sources {
        progress.set_message(source.name());
        let results = play(source, &plan, &threads, || progress.inc(1))?;
        tables.add(&results, &plan)?;
        for kind in [TreeKind::Binary, TreeKind::Library].into_iter().filter(|_| plan.has_algorithms) {
            plots::over_time(&options.out, &results, kind)?;
        }
        plots::cost(&options.out, &results)?;
    }
    progress.finish_and_clear();
    Ok(())
}

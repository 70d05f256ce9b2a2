//! The command line. Values are checked here as far as possible without opening a file or a device.

use super::session::Pace;
use super::video::film::has_format;
use clap::Parser;
use girandole::{FrameBudget, MAX_SPLITS};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;
use testbed::common::exit::one_line;
use testbed::render::backend::BackendChoice;
use testbed::render::settings::{LightChoice, MAX_CANDIDATES, Settings};
use testbed::scene::SceneError;
use testbed::scene::dusk::Dusk;
use testbed::scene_options::{SceneOptions, parse_size};

/// Longest side of a picture, pixels.
const MAX_SIDE: u32 = 16_384;
/// Most frames of a run.
const MAX_FRAMES: u32 = 100_000;
/// Most samples per pixel.
const MAX_SPP: u32 = 1 << 20;

/// Renders a night city, a glTF scene, or the street lamps of a real city, lit through two-level light trees
#[derive(Clone, Debug, Parser)]
#[command(name = "city", version)]
pub struct Options {
    /// Open a window to fly through the scene; --out receives the pictures that are saved there
    #[arg(long, conflicts_with_all = ["frames", "size", "spp", "keep_noise", "sum", "video"])]
    pub window: bool,
    /// Width and height of the window in pixels [default: 1280x720]
    #[arg(long, value_name = "WxH", requires = "window", value_parser = |text: &str| parse_size(text, 64..=MAX_SIDE))]
    pub window_size: Option<(u32, u32)>,
    /// Number of frames to render
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_FRAMES)))]
    pub frames: u32,
    /// Width and height of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "640x360", value_parser = |text: &str| parse_size(text, 1..=MAX_SIDE))]
    pub size: (u32, u32),
    /// Samples per pixel; each sample uses one light
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SPP)))]
    pub spp: u32,
    /// With --spp 1, the draws that the light which a pixel keeps from the frame before stands for, at most; 0 to keep
    /// none. Fewer forget changes sooner, and more have less noise
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(0..=1_000))]
    pub reused_frames: u32,
    /// Clusters of lights that a sample splits before it chooses a light, on the CPU; more splits lower
    /// the noise and cost time
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = parse_splits)]
    pub splits: usize,
    /// Candidate lights, of which each sample keeps one; more candidates lower the noise and cost
    /// time, but no shadow rays
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_CANDIDATES)))]
    pub candidates: u32,
    #[command(flatten)]
    pub scene: SceneOptions,
    /// The time after sunset: a sky that samples choose beside lamps, and street lamps with a photometric profile
    #[arg(long, conflicts_with_all = ["gltf", "sampler", "sum"])]
    pub dusk: bool,
    /// Let street lamps shine at dusk as this file says: IES, or EULUMDAT (.ldt)
    #[arg(long, value_name = "FILE", requires = "dusk")]
    pub ies: Option<PathBuf>,
    /// A fire of 100,000 sparks, and a dancer in a suit of lamps, on a crossing of the procedural city. The GPU moves
    /// their lights. Cars stay away, unless --cars lets them in
    #[arg(long, conflicts_with_all = ["gltf", "lamps", "sampler", "sum"])]
    pub fire: bool,
    /// Show the lights and the trees of a dump, which `LightWorld::write_dump` has written in any engine: in a window
    /// with --window, or else in the picture dump.png
    #[arg(long, value_name = "FILE", conflicts_with_all = ["gltf", "lamps", "world", "cars", "dusk", "fire", "frames", "spp", "sampler", "sum", "video", "dump"])]
    pub open: Option<PathBuf>,
    /// What the view of trees shows: 0 the box of each instance, 1 and more the boxes of nodes below its root, -1 and
    /// less those of the top level, from its lowest nodes to its root
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(i32).range(-64..=64), allow_negative_numbers = true)]
    pub level: i32,
    /// Write a dump of the light world after the last frame
    #[arg(long, value_name = "FILE", conflicts_with = "window")]
    pub dump: Option<PathBuf>,
    /// Time that rebuilds of light trees may take per frame, in milliseconds
    #[arg(long, value_name = "MS", default_value_t = 1.0, value_parser = parse_budget, allow_negative_numbers = true)]
    pub budget_ms: f64,
    /// Where to render
    #[arg(long, value_name = "WHERE", value_enum, default_value_t = BackendChoice::Auto)]
    pub backend: BackendChoice,
    /// How samples choose lights
    #[arg(long, value_name = "NAME", value_enum, default_value_t = LightChoice::Girandole)]
    pub sampler: LightChoice,
    /// Sum up all lights in every sample instead of choosing one, on the CPU: slow, but without the
    /// noise of the choice
    #[arg(long, conflicts_with = "sampler")]
    pub sum: bool,
    /// Folder for the pictures and frames.csv; created if it does not exist [default: out; with
    /// --video alone, no pictures and no table are written]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write all frames into one film: .y4m without compression, any other format (.mp4, .webm)
    /// through ffmpeg, which must be installed
    #[arg(long, value_name = "FILE", value_parser = parse_film)]
    pub video: Option<PathBuf>,
    /// Keep the noise in PNG pictures and films; by default it is filtered (EXR pictures are never
    /// filtered)
    #[arg(long)]
    pub keep_noise: bool,
    /// Frames per second of the scene's time
    #[arg(long, value_name = "HZ", default_value_t = 24.0, value_parser = parse_fps, allow_negative_numbers = true)]
    pub fps: f64,
    /// The scene's time in the first frame, in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, value_parser = parse_start, allow_negative_numbers = true)]
    pub start: f64,
}

/// The meaning of the arguments.
pub enum Parsed {
    /// Render.
    Run(Box<Options>),
    /// Print a text: the help or the version.
    Help(String),
}

impl Options {
    /// Reads the arguments, of which the first is the name of the program. An error is one line.
    pub fn read(args: impl IntoIterator<Item = impl Into<OsString> + Clone>) -> Result<Parsed, SceneError> {
        match Self::try_parse_from(args) {
            Ok(mut options) => {
                if options.fire && options.backend == BackendChoice::Auto {
                    options.backend = BackendChoice::Gpu;
                }
                if options.open.is_some() && options.backend == BackendChoice::Auto {
                    // There are no surfaces to render.
                    options.backend = BackendChoice::Cpu;
                }
                options.scene.fire = options.fire;
                options.scene.dump = options.open.clone();
                options.scene.dusk = options.dusk.then(|| Dusk { ies: options.ies.clone() });
                Ok(Parsed::Run(Box::new(options)))
            }
            Err(error) if error.use_stderr() => Err(SceneError(one_line(&error))),
            Err(help) => Ok(Parsed::Help(help.to_string())),
        }
    }

    /// The settings of the renderer.
    pub fn settings(&self) -> Settings {
        Settings {
            width: self.size.0,
            height: self.size.1,
            spp: self.spp,
            splits: self.splits,
            candidates: self.candidates,
            reused_frames: self.reused_frames,
            seed: self.scene.seed,
            light_choice: if self.sum { LightChoice::Exhaustive } else { self.sampler },
        }
    }

    /// The folder for pictures and tables; `None` if only a film is written.
    pub fn folder(&self) -> Option<&Path> {
        match (&self.out, &self.video) {
            (Some(folder), _) => Some(folder),
            (None, None) => Some(Path::new("out")),
            (None, Some(_)) => None,
        }
    }

    /// The frame rate, and the budget for rebuilds.
    pub fn pace(&self) -> Pace {
        let budget = FrameBudget::new(Duration::from_secs_f64(self.budget_ms * 1e-3));
        Pace { fps: self.fps, start: self.start, budget }
    }
}

fn parse_splits(text: &str) -> Result<usize, String> {
    let count = text.parse().ok().filter(|count| *count <= MAX_SPLITS);
    count.ok_or_else(|| format!("expected a number from 0 to {MAX_SPLITS}"))
}

fn parse_budget(text: &str) -> Result<f64, String> {
    // The limit of one hour keeps the duration far from overflow.
    match text.parse::<f64>() {
        Ok(ms) if (0.0..=3.6e6).contains(&ms) => Ok(ms),
        _ => Err("expected milliseconds, from 0 to 3600000".into()),
    }
}

fn parse_film(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    if has_format(&path) {
        Ok(path)
    } else {
        Err("expected a file name with an extension, such as .y4m or .mp4".into())
    }
}

fn parse_fps(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(fps) if (1e-3..=1e6).contains(&fps) => Ok(fps),
        _ => Err("expected frames per second, from 0.001 to 1000000".into()),
    }
}

fn parse_start(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(start) if (0.0..=1e7).contains(&start) => Ok(start),
        _ => Err("expected seconds, from 0 to 10000000".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use girandole::glam::Vec3;
    use testbed::scene::procedural::Size;

    fn parse(args: &str) -> Result<Options, SceneError> {
        match Options::read(std::iter::once("city").chain(args.split_whitespace()))? {
            Parsed::Run(options) => Ok(*options),
            Parsed::Help(text) => panic!("{text}"),
        }
    }

    #[test]
    fn invalid_values_are_refused_with_one_line() {
        for bad in [
            "--size 0x5",
            "--size 5",
            "--size 16385x1",
            "--size -1x4",
            "--spp 0",
            "--splits 9",
            "--candidates 0",
            "--candidates 33",
            "--frames 0",
            "--budget-ms nan",
            "--budget-ms -1",
            "--budget-ms inf",
            "--fps 0",
            "--start -1",
            "--start nan",
            "--camera 1,2,3",
            "--camera 1,2,3,1,2,3",
            "--camera 1,2,nan,1,2,4",
            "--world XL",
            "--exposure nan",
            "--exposure 20.5",
            "--exposure -21",
            "--exposure bright",
            "--backend gl",
            "--gltf a.glb --lamps b.csv",
            "--gltf a.glb --cars 5",
            "--gltf a.glb --dusk",
            "--dusk --sum",
            "--gltf a.glb --fire",
            "--lamps a.csv --fire",
            "--fire --sampler roots",
            "--fire --sum",
            "--ies lamp.ies",
            "--lamps a.csv --world S",
            "--lamps a.csv --cars 5",
            "--sampler all",
            "--sampler exhaustive",
            "--sum --sampler roots",
            "--video film",
            "--video .mp4",
            "--open a.dump --gltf a.glb",
            "--open a.dump --cars 5",
            "--open a.dump --dump b.dump",
            "--window --dump b.dump",
            "--level 65",
            "--unknown",
        ] {
            let line = parse(bad).unwrap_err().0;
            assert!(!line.is_empty() && !line.contains('\n'), "{bad}: {line}");
        }
    }

    #[test]
    fn valid_values_are_accepted() {
        let options = parse("--size 64x36 --camera -8,2,6,2,3.5,-14 --budget-ms 0.5 --world m").unwrap();
        assert_eq!(options.size, (64, 36));
        assert_eq!(options.scene.camera, Some((Vec3::new(-8.0, 2.0, 6.0), Vec3::new(2.0, 3.5, -14.0))));
        assert_eq!(options.scene.world, Size::M);
        assert_eq!([parse("--exposure -20").unwrap().scene.exposure, parse("").unwrap().scene.exposure], [-20.0, 0.0]);
        let backend = |args| parse(args).unwrap().backend;
        assert_eq!([backend(""), backend("--fire --dusk")], [BackendChoice::Auto, BackendChoice::Gpu]);
        assert_eq!(backend("--fire --backend cpu"), BackendChoice::Cpu, "which a run refuses");
        let cars = |args| parse(args).unwrap().scene.procedural_cars();
        assert_eq!(["", "--fire", "--fire --cars 7"].map(cars), [Some(Size::S.default_cars()), Some(0), Some(7)]);
        let opened = parse("--open a.dump --level -2").unwrap();
        assert_eq!((opened.backend, opened.level, opened.scene.procedural_cars()), (BackendChoice::Cpu, -2, None));
        let folder = |args| parse(args).unwrap().folder().map(|folder| folder.display().to_string());
        assert_eq!(folder("").as_deref(), Some("out"));
        assert_eq!(folder("--out a --video b.mp4").as_deref(), Some("a"));
        assert_eq!(folder("--video b.mp4"), None);
        let choice = |args| parse(args).unwrap().settings().light_choice;
        assert_eq!(choice(""), LightChoice::Girandole);
        assert_eq!(choice("--sampler roots"), LightChoice::Roots);
        assert_eq!(choice("--sum"), LightChoice::Exhaustive);
    }
}

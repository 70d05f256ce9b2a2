//! The command line. Values are checked here as far as possible without opening a file or a device.

use super::render::backend::BackendChoice;
use super::render::settings::{LightChoice, Settings};
use super::scene::SceneError;
use super::scene_options::{SceneOptions, parse_size};
use super::session::Pace;
use crate::common::exit::one_line;
use clap::Parser;
use girandole::FrameBudget;
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

/// Longest side of a picture, pixels.
const MAX_SIDE: u32 = 16_384;
/// Most frames of a run.
const MAX_FRAMES: u32 = 100_000;
/// Most samples per pixel.
const MAX_SPP: u32 = 1 << 20;

/// Renders a night city, a glTF scene, or the lamps and traffic of a real city, lit through
/// two-level light trees
#[derive(Clone, Debug, Parser)]
#[command(name = "city", version)]
pub struct Options {
    /// Number of frames to render
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_FRAMES)))]
    pub frames: u32,
    /// Width and height of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "640x360", value_parser = |text: &str| parse_size(text, 1..=MAX_SIDE))]
    pub size: (u32, u32),
    /// Samples per pixel; each sample uses one light
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SPP)))]
    pub spp: u32,
    #[command(flatten)]
    pub scene: SceneOptions,
    /// Time that rebuilds of light trees may take per frame, in milliseconds
    #[arg(long, value_name = "MS", default_value_t = 1.0, value_parser = parse_budget, allow_negative_numbers = true)]
    pub budget_ms: f64,
    /// Where to render
    #[arg(long, value_name = "WHERE", value_enum, default_value_t = BackendChoice::Auto)]
    pub backend: BackendChoice,
    /// Folder for the pictures and frames.csv; created if it does not exist
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Keep the noise in the PNG pictures; by default it is filtered (EXR pictures are never
    /// filtered)
    #[arg(long)]
    pub keep_noise: bool,
    /// Frames per second of the scene's time
    #[arg(long, value_name = "HZ", default_value_t = 24.0, value_parser = parse_fps, allow_negative_numbers = true)]
    pub fps: f64,
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
            Ok(options) => Ok(Parsed::Run(Box::new(options))),
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
            seed: self.scene.seed,
            light_choice: LightChoice::Tree,
        }
    }

    /// The frame rate, and the budget for rebuilds.
    pub fn pace(&self) -> Pace {
        Pace { fps: self.fps, budget: FrameBudget::new(Duration::from_secs_f64(self.budget_ms * 1e-3)) }
    }
}

fn parse_budget(text: &str) -> Result<f64, String> {
    // The limit of one hour keeps the duration far from overflow.
    match text.parse::<f64>() {
        Ok(ms) if (0.0..=3.6e6).contains(&ms) => Ok(ms),
        _ => Err("expected milliseconds, from 0 to 3600000".into()),
    }
}

fn parse_fps(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(fps) if (1e-3..=1e6).contains(&fps) => Ok(fps),
        _ => Err("expected frames per second, from 0.001 to 1000000".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::city::scene::procedural::Size;
    use girandole::glam::Vec3;

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
            "--frames 0",
            "--budget-ms nan",
            "--budget-ms -1",
            "--budget-ms inf",
            "--fps 0",
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
            "--traffic a.xml --world S",
            "--net a.net.xml --world S",
            "--gltf a.glb --net b.net.xml",
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
        assert_eq!(parse("").unwrap().backend, BackendChoice::Auto);
    }
}

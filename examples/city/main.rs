//! A night city with moving cars, lit through two-level light trees: one light a sample, picked from all of them.
//!
//! ```text
//! cargo run --release --example city
//! ```
//!
//! renders a few frames into `out/`: `frame_0000.png` to look at, `frame_0000.exr` with radiance, and `frames.csv` with
//! what each frame cost. `--help` lists what else it draws: other sizes of city, glTF scenes, a real city's lamps.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program talks to its user")]

#[path = "modules.rs"]
mod city;

use city::app::Session;
use city::options::Options;
use city::output::Output;
use city::scene::procedural::{self, CityOptions};
use city::scene::{SceneError, Stage};
use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use std::process::ExitCode;
use std::time::Duration;

fn main() -> ExitCode {
    let options = match Options::try_parse() {
        Ok(options) => options,
        Err(error) if error.use_stderr() => {
            // clap explains over several lines; the first says what is wrong.
            let text = error.to_string();
            eprintln!("{}", text.lines().next().unwrap_or("error: bad arguments"));
            return ExitCode::from(2);
        }
        Err(help) => {
            print!("{help}");
            return ExitCode::SUCCESS;
        }
    };
    match run(&options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(SceneError(message)) => {
            eprintln!("error: {message}");
            ExitCode::from(2)
        }
    }
}

fn run(options: &Options) -> Result<(), SceneError> {
    let mut stage = load(options)?;
    options.aim(&mut stage.scene.camera);
    let chosen = city::backend::choose(options.backend)?;
    let backend = chosen.to_string();
    println!("{backend}");
    let mut session = Session::new(stage, options.settings(), chosen)?;
    let mut output = Output::new(&options.out)?;

    const TICKS: u64 = 1000;
    let bar = ProgressBar::new(u64::from(options.frames) * TICKS);
    let template = "{msg} [{bar:40}] {percent}% {elapsed}, {eta} to go";
    bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(Duration::from_millis(250));
    let (mut lights, mut total) = (0, Duration::ZERO);
    for number in 0..options.frames {
        bar.set_message(format!("frame {number}"));
        let base = u64::from(number) * TICKS;
        let frame = session.frame(&|share| bar.set_position(base + (share * TICKS as f64) as u64))?;
        output.write(&frame, session.scene().exposure)?;
        lights = frame.record.lights;
        total += frame.record.frame_time;
    }
    bar.finish_and_clear();
    output.finish()?;
    let (width, height) = options.size;
    println!(
        "{} frames of {width}x{height}, {} samples a pixel, {lights} lights: {:.2} s a frame; pictures in {}",
        options.frames,
        options.spp,
        total.as_secs_f64() / f64::from(options.frames),
        options.out.display(),
    );
    Ok(())
}

fn load(options: &Options) -> Result<Stage, SceneError> {
    procedural::stage(&CityOptions { size: options.world, cars: options.cars, seed: options.seed })
}

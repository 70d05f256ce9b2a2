//! How noisy one light sample is, without noise in the answer: this library beside published samplers.
//!
//! ```text
//! cargo run --release --example variance -- --out variance.csv [--gltf FILE] [--shading points N] [--world S|M] [--deform | --candidates]
//! ```
//!
//! prints a table and writes it as CSV: for each scene and sampler the exact relative standard deviation of one sample
//! over fixed shading points (`sigma.rs`), nanoseconds a draw, and bytes of tree a light. Expect `girandole` well below
//! `pbrt` and `cycles`. With `--deform` another table, of moving lights (`deform.rs`), whose city is always S; with
//! `--candidates` one of several candidates for a sample (`candidates.rs`). `docs/benchmarks.md` holds all tables,
//! measured, and their rules.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program talks to its user")]

mod baselines;
mod candidates;
mod deform;
mod lights;
mod measure;
mod shading_points;
mod report;
mod samplers;
#[path = "../../city/scene/mod.rs"]
#[allow(dead_code, reason = "the city draws what is only measured here")]
mod scene;
mod sigma;
mod stages;
mod timing;

use clap::Parser;
use scene::SceneError;
use scene::procedural::Size;
use std::path::PathBuf;
use std::process::ExitCode;

/// Measures the noise of one light sample.
#[derive(Parser)]
#[command(name = "variance", version)]
struct Options {
    /// The table, as CSV
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
    /// A glTF scene to measure too
    #[arg(long, value_name = "FILE")]
    gltf: Option<PathBuf>,
    /// Measure what moving lights cost a tree instead, in time and noise
    #[arg(long, conflicts_with = "world")]
    deform: bool,
    /// Measure what several candidates for a sample bring instead
    #[arg(long, conflicts_with = "deform")]
    candidates: bool,
    /// Points that light arrives at
    #[arg(long, default_value_t = 400, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    shading_points: u32,
    /// How large the procedural city is
    #[arg(long, value_enum, ignore_case = true, default_value_t = Size::S)]
    world: Size,
}

fn run(options: &Options) -> Result<(), SceneError> {
    let count = options.shading_points as usize;
    if options.deform {
        return deform::run(options.gltf.as_deref(), count, &options.out);
    }
    if options.candidates {
        return candidates::run(options.world, options.gltf.as_deref(), count, &options.out);
    }
    let mut scenes = Vec::from(stages::city(options.world, count)?);
    if let Some(path) = &options.gltf {
        scenes.push(stages::gltf(path, count)?);
    }
    let mut table = report::Table::create(&options.out, &report::COLUMNS)?;
    scenes.iter().try_for_each(|scene| {
        let measured = measure::measure(scene)?;
        report::print(&measured);
        report::write(&mut table, &measured.rows)
    })
}

fn main() -> ExitCode {
    match run(&Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

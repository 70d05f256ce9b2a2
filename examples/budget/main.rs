//! What a rebuild buys, and where a frame's budget is spent best.
//!
//! ```text
//! cargo run --release --example budget -- --fit
//! cargo run --release --example budget -- --stages S10|M100|L1000 [--receivers N]
//! ```
//!
//! `--fit` prints how well a tree's attributes tell what a rebuild would buy (`fit.rs`); `--stages` what is at stake in
//! the scenes (`check.rs`).
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program talks to its user")]

mod check;
mod figures;
mod fit;
mod motion;
mod noise;
mod observations;
mod rays;
mod regression;
mod scale;
#[path = "../city/scene/mod.rs"]
#[allow(dead_code, reason = "the city draws what is only measured here")]
mod scene;
#[path = "../variance/sigma.rs"]
#[allow(dead_code, reason = "the variance example sums it up in another way")]
mod sigma;
#[allow(dead_code, reason = "for the strategies to come")]
mod stage;

use clap::Parser;
use scene::SceneError;
use stage::SceneKind;
use std::process::ExitCode;

/// Measures what rebuilds buy.
#[derive(Parser)]
#[command(name = "budget", version)]
struct Options {
    /// Fit what attributes tell of noise
    #[arg(long)]
    fit: bool,
    /// Measure what is at stake in a scene
    #[arg(long, value_enum, ignore_case = true)]
    stages: Option<SceneKind>,
    /// Points that light arrives at
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    receivers: u32,
}

fn main() -> ExitCode {
    let options = Options::parse();
    let fit = if options.fit { fit::run().map_err(SceneError::from) } else { Ok(()) };
    let stages = |()| options.stages.map_or(Ok(()), |kind| check::run(kind, options.receivers as usize));
    match fit.and_then(stages) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

//! What a rebuild buys, and where a frame's budget is spent best.
//!
//! ```text
//! cargo run --release --example budget -- --stages S10|M100|L1000 [--receivers N]
//! ```
//!
//! `--stages` prints what is at stake in the scenes (`check.rs`).
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program talks to its user")]

mod check;
#[allow(dead_code, reason = "names for the tables to come")]
mod figures;
mod motion;
mod noise;
mod rays;
#[path = "../city/scene/mod.rs"]
#[allow(dead_code, reason = "the city draws what is only measured here")]
mod scene;
#[path = "../variance/sigma.rs"]
#[allow(dead_code, reason = "the variance example sums it up in another way")]
mod sigma;
#[allow(dead_code, reason = "for the strategies to come")]
mod stage;

use clap::Parser;
use stage::SceneKind;
use std::process::ExitCode;

/// Measures what rebuilds buy.
#[derive(Parser)]
#[command(name = "budget", version)]
struct Options {
    /// Measure what is at stake in a scene
    #[arg(long, value_enum, ignore_case = true)]
    stages: Option<SceneKind>,
    /// Points that light arrives at
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    receivers: u32,
}

fn main() -> ExitCode {
    let options = Options::parse();
    match options.stages.map_or(Ok(()), |kind| check::run(kind, options.receivers as usize)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

//! What a time budget for rebuilds buys, in noise, and whether it is kept: the library's scheduler beside others.
//!
//! ```text
//! cargo run --release --example budget -- --out DIR [--quick] [--costs FILE] [--scene A,B] [--motion A,B] [--strategies A,B]
//! cargo run --release --example budget -- --stages S10|M100|L1000 [--shading points N]
//! cargo run --release --example budget -- --fit
//! ```
//!
//! Plays deforming trees in several motions, each under several strategies and budgets, and measures the exact relative
//! standard deviation of one light sample at fixed shading points every few frames. Time is virtual: what work takes was
//! measured at the start (`costs.rs`), written to DIR/costs.csv, and is drawn from there, so that a run with `--costs
//! DIR/costs.csv` repeats bit for bit. **A stall of the machine while costs are measured is among them**, and comes back
//! as often as it was seen: frames are over their budget then whatever decides. Of builds the faster of two counts, but
//! measure while nothing else runs, and look at the largest costs first.
//!
//! Writes budget.csv (a line for each scene, motion, strategy and budget), over_time.csv (noise by frame), scenes.csv
//! (what the others are relative to: noise of both ends, time of rebuilding always, the smallest job), and two SVG plots
//! a scene. Expect `girandole` near `oracle`, above round robin and oldest first. `--quick` takes less than a minute,
//! all of it about 25. `docs/benchmarks.md` holds a measured run. `--stages` prints what is at stake in a scene
//! (`check.rs`), `--fit` how well a tree's attributes tell what a rebuild would buy (`fit.rs`).
//!
//! Budgets are shares of what rebuilding everything that changed takes, in the mean of all frames. What is rebuilt by
//! hand (round robin, oldest first, the oracle) is rebuilt within the frame if a whole frame's budget has room for it;
//! else on the side, and the frames that follow pay for it. That time counts as spent but belongs to no frame, as the
//! library's builds in the background.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program talks to its user")]

#[path = "../variance/lights.rs"]
#[allow(dead_code, reason = "the variance example carries lights into the world too")]
mod lights;
#[path = "modules.rs"]
#[allow(dead_code, reason = "what trees are is for those who look closer")]
mod modules;
#[path = "../../city/scene/mod.rs"]
#[allow(dead_code, reason = "the city draws what is only measured here")]
mod scene;
#[path = "../variance/sigma.rs"]
#[allow(dead_code, reason = "the variance example sums up more")]
mod sigma;

use clap::Parser;
use modules::options::{Options, run};
use std::process::ExitCode;

fn main() -> ExitCode {
    match run(&Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

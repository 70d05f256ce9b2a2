//! What upload, the top level and sampling cost on this machine's GPU.
//!
//! ```text
//! cargo run --release --example gpu_timings -- --out gpu_timings.json [--quick] [--adapter NAME]
//! ```
//!
//! prints three tables as Markdown and writes their numbers as JSON: upload of 1, 10 and 100 % moved instances; each
//! stage of the top level from 1,000 to 1,000,000 instances, beside a radix sort of as many keys alone; samples a
//! second in the procedural cities S, M and L, for one sample and for eight candidates, with the nodes and bytes that
//! they read. On the GPU by timestamps, apart from submission, where the adapter has them. Takes a few minutes at
//! most; a copy of the binary runs by itself. `--quick` takes seconds and is for trying it out. `docs/benchmarks.md`
//! holds measured tables.
#![allow(clippy::print_stderr, reason = "a program talks to its user")]

#[path = "../../city/modules.rs"]
#[allow(dead_code, reason = "the city renders what is only looked at here")]
mod city;
#[path = "modules.rs"]
mod modules;

use city::render::{geometry, shading};
use city::scene;

use clap::Parser;
use modules::run::{Options, run};
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

//! The time of upload, top-level build and sampling on this machine's GPU.
//!
//! ```text
//! cargo run --release --example gpu_timings -- --out gpu_timings.json [--quick] [--adapter NAME]
//!     [--only upload|top-level|sampling]
//! ```
//!
//! The program first compares the GPU with the CPU, and ends if they disagree. Then it prints three
//! tables as Markdown, with a verdict on each goal, and writes all numbers as JSON:
//!
//! 1. upload, where 1, 10 and 100 % of the instances have moved;
//! 2. each stage of the top-level build over 1,000 to 1,000,000 instances, and a radix sort alone
//!    of as many keys;
//! 3. samples per second in the procedural cities S, M and L, with one candidate and with eight,
//!    and the nodes and bytes that a sample reads.
//!
//! Where the adapter has timestamps, times are those of the GPU without submission. The run takes a
//! few minutes at most, and `--quick` seconds. Expect a sample of eight candidates to read more
//! nodes than one of a single candidate, but far fewer than eight times as many. The binary
//! needs no files and can be copied to another machine. `docs/benchmarks.md` has measured tables.

#[path = "../../city/modules.rs"]
#[allow(dead_code, reason = "the city example renders frames; this tool only uses its scenes and camera")]
mod city;
#[path = "../../common/mod.rs"]
#[allow(dead_code, reason = "other programs use more of it")]
mod common;
#[path = "../../measuring/mod.rs"]
#[allow(dead_code, reason = "other programs use more of it")]
mod measuring;
#[path = "modules.rs"]
mod modules;

use city::render::{geometry, shading};
use city::scene;

use modules::run::run;
use std::process::ExitCode;

fn main() -> ExitCode {
    common::exit::run_program(run)
}

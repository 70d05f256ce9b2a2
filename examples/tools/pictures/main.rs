//! The same view in the same time by three samplers, side by side: the picture of the README.
//!
//! ```text
//! cargo run --release --example pictures -- --out docs/equal_time.png
//!     [--world S|M|L] [--us-per-pixel N] [--glossy] [--samples A,B,C] [--quick]
//! ```
//!
//! The program renders the procedural city from its default camera, as the city example's first
//! frame. Each sample chooses one light: by flux alone, by pbrt-v4's formula, or by Girandole in
//! two levels. The formula is on a binary tree and in a variant for opaque surfaces
//! (`../variance/baselines/pbrt.rs`), which has less noise than the published one. All three
//! samplers draw the same random numbers and share the code for shadow rays and shading. Nothing is
//! denoised.
//!
//! The view differs from the city example in two respects: the moon is left out, because it belongs
//! to no tree, and surfaces are matte, because no formula here knows about gloss (`--glossy` keeps
//! the city's materials).
//!
//! The time per sample is measured first, on one thread. Then each picture gets as many samples per
//! pixel as fit into the given time. A picture of many samples by Girandole, with other random
//! numbers, is the reference. The output is one PNG with three pictures, and a table:
//!
//! - samples per pixel, microseconds per sample, and seconds per picture on all threads;
//! - the exact sigma of one choice without shadows (`../variance/sigma.rs`);
//! - MAPE and relMSE (`score.rs`), from four pictures that differ in their random numbers;
//! - the mean luminance relative to the reference.
//!
//! Expect Girandole to have the fewest samples and by far the least error, and means that agree
//! within the noise. Times differ from run to run, and so do pictures. With `--samples A,B,C`, the
//! samples per pixel of a printed table, its pictures repeat bit for bit. The whole run takes about
//! two minutes on two cores; `--quick` takes seconds.

#[path = "../variance/baselines/mod.rs"]
#[allow(dead_code, unused_imports, reason = "the variance tool compares more samplers")]
mod baselines;
#[path = "../../city/modules.rs"]
#[allow(dead_code, reason = "the city example renders frames; this tool only uses its scene and shading")]
mod city;
#[path = "../../common/mod.rs"]
#[allow(dead_code, reason = "other programs use more of it")]
mod common;
#[path = "../variance/lights.rs"]
mod lights;
#[path = "modules.rs"]
mod modules;
#[path = "../variance/samplers.rs"]
#[allow(dead_code, reason = "the variance tool compares more samplers")]
mod samplers;
#[path = "../variance/sigma.rs"]
#[allow(dead_code, reason = "the variance tool prints more statistics")]
mod sigma;

use modules::run::run;
use std::process::ExitCode;

fn main() -> ExitCode {
    common::exit::run_program(|options| run(options).map(drop))
}

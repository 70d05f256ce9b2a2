//! A night city with moving cars, lit through two-level light trees: each sample uses one light out
//! of all.
//!
//! ```text
//! cargo run --release --example city
//! ```
//!
//! This renders two frames into the folder `out`: a picture for the screen (`frame_0000.png`), its
//! radiance (`frame_0000.exr`), and the costs of each frame (`frames.csv`). At the end it prints
//! which effects the lights needed and how many shadow rays were traced. `--compare` renders the
//! same view by other samplers in equal time, with their errors. `--video FILE` writes a film.
//! `--help` lists the options: other sizes of city, glTF scenes, and the lamps and the traffic of a
//! real city.
//!
//! `frames.csv` has a row for each finished frame at any moment of the run. `app/output.rs` explains
//! its columns; `frame_ms` is the sum of the times of all stages, from moving the scene to writing the
//! pictures.
//!
//! `modules.rs` lists the parts: `scene` (what is drawn), `render` (how) and `app` (the program).
//! Each folder's `mod.rs` states the order in which to read its files; `app/session.rs` shows how
//! the library is used.
#![allow(clippy::print_stdout, reason = "a program prints for its user")]

#[path = "modules.rs"]
mod city;
#[path = "../common/mod.rs"]
#[allow(dead_code, reason = "other programs use more of it")]
mod common;
#[path = "../measuring/mod.rs"]
#[allow(dead_code, reason = "other programs use more of it")]
mod measuring;

use city::app::options::{Options, Parsed};
use std::process::ExitCode;

fn main() -> ExitCode {
    let result = match Options::read(std::env::args_os()) {
        Ok(Parsed::Run(options)) if options.compare => {
            city::app::compare::run::compare(&options, &mut |line| println!("{line}")).map(drop)
        }
        Ok(Parsed::Run(options)) => city::app::run::run(&options, &mut |line| println!("{line}")),
        Ok(Parsed::Help(text)) => {
            print!("{text}");
            Ok(())
        }
        Err(error) => Err(error),
    };
    common::exit::exit_code(result)
}

//! A night city with moving cars, lit through two-level light trees: each sample uses one light out
//! of all.
//!
//! ```text
//! cargo run --release --example city
//! ```
//!
//! This renders two frames into the folder `out`: a picture for the screen (`frame_0000.png`), its
//! radiance (`frame_0000.exr`), and the costs of each frame (`frames.csv`). At the end it prints
//! which effects the lights needed and how many shadow rays were traced. `--window` opens a window to
//! fly through the scene, `--compare` renders the same view by other samplers in equal time, with
//! their errors, and `--video FILE` writes a film. `docs/city.md` and `--help` tell the rest: other
//! sizes of city, glTF scenes, and the lamps, traffic, roads and buildings of a real city.
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

#[path = "window/mod.rs"]
mod window;

use city::app::options::{Options, Parsed};
use std::process::ExitCode;

fn main() -> ExitCode {
    let result = match Options::read(std::env::args_os()) {
        Ok(Parsed::Run(options)) if options.window => window::shell::run(&options, &mut |line| println!("{line}")),
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

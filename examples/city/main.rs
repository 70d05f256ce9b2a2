//! A night city with moving cars, lit through two-level light trees: one light a sample, picked from all of them.
//!
//! ```text
//! cargo run --release --example city
//! ```
//!
//! renders a few frames into `out/`: `frame_0000.png` to look at, `frame_0000.exr` with radiance, and `frames.csv` with
//! what each frame cost. It ends with which effects the lights called for and how many shadow rays were traced. `--help`
//! lists what else it draws: other sizes of city, glTF scenes, a real city's lamps.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program talks to its user")]

#[path = "modules.rs"]
mod city;
#[path = "../common/mod.rs"]
#[allow(dead_code, reason = "other programs use more of it")]
mod common;

use city::app::options::{Options, Parsed};
use std::process::ExitCode;

fn main() -> ExitCode {
    let result = match Options::read(std::env::args_os()) {
        Ok(Parsed::Run(options)) => city::app::run::run(&options, &mut |line| println!("{line}")),
        Ok(Parsed::Help(text)) => {
            print!("{text}");
            Ok(())
        }
        Err(e) => Err(e),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error: {e}");
            ExitCode::from(2)
        }
    }
}

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
//! fly through the scene, and `--compare` renders the same view by other samplers in equal time, with
//! their errors. `--help` lists the options: other sizes of city, glTF scenes, films, and the lamps,
//! the traffic, the roads and the buildings of a real city. All files of a real city fit together if
//! they have the same metres:
//!
//! ```text
//! cargo run --release --example city -- --lamps lamps.csv --traffic fcd.xml \
//!     --vtypes types.rou.xml --net city.net.xml --buildings buildings.geojson
//! ```
//!
//! Lamps and buildings have the metres that the network had before `netconvert` moved it. Traffic has
//! those after, which `--net` undoes.
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

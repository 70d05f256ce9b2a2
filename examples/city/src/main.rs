//! A night city with moving cars, lit through two-level light trees: each sample uses one light out
//! of all.
//!
//! ```text
//! cargo run --release -p city
//! ```
//!
//! This renders two frames into the folder `out`: a picture for the screen (`frame_0000.png`), its
//! radiance (`frame_0000.exr`), and the costs of each frame (`frames.csv`). At the end it prints
//! which effects the lights needed and how many shadow rays were traced. `--window` opens a window to
//! fly through the scene, `--video FILE` writes a film, and `--open FILE` shows a dump of any engine's
//! lights. `docs/city.md` and `--help` tell the rest: other
//! sizes of city, glTF scenes, and the street lamps of a real city.
//!
//! Scenes and the renderer are in the package `testbed`, and `app` is the program. Each folder's `mod.rs` states the order in which to read its files; `app/session.rs` shows how
//! the library is used.

use city::app::options::{Options, Parsed};
use std::process::ExitCode;

fn main() -> ExitCode {
    let options = city::app::files::clean_up_on_interrupt().and_then(|()| Options::read(std::env::args_os()));
    let result = match options {
        Ok(Parsed::Run(options)) if options.window => {
            city::window::shell::run(&options, &mut |line| testbed::say!("{line}"))
        }
        Ok(Parsed::Run(options)) if options.open.is_some() => {
            city::window::still::run(&options, &mut |line| testbed::say!("{line}"))
        }
        Ok(Parsed::Run(options)) => city::app::run::run(&options, &mut |line| testbed::say!("{line}")),
        Ok(Parsed::Help(text)) => {
            testbed::common::exit::print(&text);
            Ok(())
        }
        Err(error) => Err(error),
    };
    testbed::common::exit::exit_code(result)
}

//! Bakes the lights of a glTF scene: one file for each light tree, and a list of their instances.
//! A game loads them without building anything.
//!
//! ```text
//! cargo run --release -p bake -- scene.glb out/
//! ```
//!
//! It writes `out/0000.tree` and so on, and `out/scene.txt`. Then it loads all files again, as a
//! game would: a worker thread loads the trees, and the thread of the world takes them. Expect a
//! table of times and sizes, and the line "10000 samples of both worlds agree". The time of the load
//! is a small part of that of the build, and all samples are equal bit for bit.
//!
//! The trees may be loaded on any machine. A later version of the library may refuse them: keep the
//! scene, and bake it again.

use bake::options::run;
use std::process::ExitCode;

fn main() -> ExitCode {
    testbed::common::exit::run_program(run)
}

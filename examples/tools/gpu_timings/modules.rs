//! The example's own modules, beside what it takes from the city. `main.rs` and a test both include this file.
#![allow(clippy::print_stdout, reason = "a program talks to its user")]

use super::{geometry, scene, shading};

pub mod spread;
pub mod timer;

pub mod machine;
pub mod shading_points;
pub mod sampling;
pub mod top_level;
pub mod uploads;

pub mod report;
pub mod run;

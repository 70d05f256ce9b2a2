//! The tool's modules, in the order in which data passes through them. `main.rs` and a test include
//! this file.

use super::{city, lights, samplers, sigma};

pub mod view;

pub mod sampling;
pub mod score;

pub mod font;
pub mod sheet;

pub mod run;

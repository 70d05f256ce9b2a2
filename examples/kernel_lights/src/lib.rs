//! The program's own modules, in the order in which data passes through them. `main.rs` and a test include
//! this file.

pub mod kernel;
pub mod motion;

pub mod cost;
pub mod noise;

pub mod run;

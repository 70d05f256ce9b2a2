//! Code that the examples, tests and benches share.
//!
//! The root of a program includes this folder with `#[path]` as `mod common`; all other files refer
//! to it as `crate::common`.

pub mod exit;
pub mod gpu;
pub mod hash;
pub mod lattice;
pub mod pcg;
pub mod progress;
pub mod split_mix;
pub mod stopwatch;
pub mod table;

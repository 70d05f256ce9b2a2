//! The tool's own modules, in the order in which data passes through them. `main.rs` and a test
//! include this file.
#![allow(clippy::print_stderr, reason = "a program talks to its user")]

use testbed::measuring::{lights, sigma};

pub mod figures;
pub mod motion;
pub mod rays;
pub mod stage;

pub mod check;
pub mod lit;
pub mod noise;

pub mod fit;
pub mod observations;
pub mod regression;
pub mod scale;

pub mod costs;
pub mod oracle;
pub mod reference;
pub mod strategies;

pub mod player;
pub mod run;

pub mod cases;

pub mod plots;
pub mod report;

pub mod options;

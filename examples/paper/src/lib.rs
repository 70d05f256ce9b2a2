//! The program's own modules, in the order in which data passes through them. `main.rs` and a test
//! include this file.

pub mod decisions;
pub mod strategies;

pub mod vehicles;
pub mod stages;

pub mod trees;
pub mod pool;
pub mod worlds;

pub mod survey;
pub mod pictures;
pub mod play;

pub mod results;
pub mod report;
pub mod plots;

pub mod options;

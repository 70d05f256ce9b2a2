//! The tool's own modules, in the order in which data passes through them. `main.rs` and a test
//! include this file.

pub mod spread;
pub mod timer;

pub mod machine;
pub mod shading_points;
pub mod sampling;
pub mod top_level;
pub mod uploads;

pub mod checks;
pub mod goals;

pub mod report;
pub mod run;

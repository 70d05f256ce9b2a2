//! The noise of one light sample, computed exactly: this library beside published samplers.
//!
//! `measure noise [QUESTION] --out FILE.csv`; `--help` lists the questions, and each has a file here. For each
//! scene and sampler, `samplers` prints the exact relative standard deviation of one sample over fixed shading points
//! (`examples/testbed/src/measuring/sigma.rs`), the share of draws that end without a light (`dead`), nanoseconds per
//! choice, and bytes of tree per light. `docs/benchmarks.md` has measured tables and the rules of measurement.

pub mod effort;
pub mod stages;
pub mod shading_points;
pub mod measure;
pub mod report;
pub mod timing;
pub mod deform;
pub mod candidates;
pub mod gloss;
pub mod segments;
pub mod torture;
pub mod places;
pub mod receivers;
pub mod learning;
pub mod sky;
pub mod signs;
pub mod window;
pub mod kept;
pub mod options;

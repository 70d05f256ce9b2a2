//! `--compare`: the same view by several samplers in equal time, against a reference.
//!
//! Read in this order:
//!
//! 1. `measure`: renders the pictures, takes their times and computes their errors;
//! 2. `report`: writes the table, the plot and the pictures;
//! 3. `run`: the whole comparison.

use super::{files, options, session};

pub mod measure;
pub mod report;
pub mod run;

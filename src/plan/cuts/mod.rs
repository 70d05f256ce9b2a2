//! Cuts that neighbours share, on the GPU: shaders mark the cells of their shading points, kernels build a cut
//! for each cell, and other shaders of the same frame choose lights from these.
//!
//! docs/cuts.md says when to use them.

mod kernels;
pub(crate) mod layout;
mod planner;
mod store;

pub use kernels::cut_kernels;
pub(super) use store::{CutStore, Table};

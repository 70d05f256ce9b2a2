//! Learnt visibility on the GPU: shaders record what shadow rays found, kernels fold the records into a table
//! once a frame, and the next frame's choices read it.
//!
//! docs/cuts.md says when to use it.

mod planner;
mod store;

pub use store::visibility_kernels;
pub(super) use store::{Table, VisibilityStore};

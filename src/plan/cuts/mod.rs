//! Cells on the GPU: shaders mark those of their shading points, kernels build a cut for each, and shaders choose lights
//! from these. Shaders record what shadow rays find, and kernels fold the records into what cells have learnt.
//!
//! docs/cuts.md says when to use them.

mod kernels;
pub(crate) mod layout;
mod learning;
mod planner;
mod store;

pub use kernels::cut_kernels;
pub use learning::visibility_kernels;
pub(super) use store::CutStore;

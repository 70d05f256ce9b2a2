//! Learnt visibility on the GPU: shaders record what shadow rays found, a kernel folds the records into a table
//! once a frame, and the next frame's choices read it.
//!
//! docs/visibility.md says when to use it.

mod planner;
mod store;

pub use store::visibility_kernel;
pub(super) use store::{Table, VisibilityStore};

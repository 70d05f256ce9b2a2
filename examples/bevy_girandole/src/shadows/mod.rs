//! Shadows without ray tracing hardware: a tree of boxes for each mesh, and trees over all entities.
//!
//! `gather` finds in the main world what casts shadows and builds a `mesh` on other threads, over a `flat` tree.
//! In the render world, `scene` keeps the trees over entities (`top`), and the buffers that `shadow.wgsl` reads.

mod flat;
mod gather;
mod mesh;
mod scene;
mod top;

pub use gather::{Casters, gather, gather_moves};
pub use scene::{GirandoleShadows, extract, prepare, start};

//! Shadows by rays: by ray queries of the device, or by trees that the plugin builds.
//!
//! `gather` finds in the main world what casts shadows and prepares each `mesh` on other threads. In the render
//! world, `scene` keeps the meshes and entities in step with a `Tracer`. There are two of them. `structures` has the
//! acceleration structures that ray queries read (`shadow_query.wgsl`). `trees` has trees of boxes and works without
//! ray queries (`shadow_walk.wgsl`): a `flat` tree for each mesh, and those over all entities (`top`).

mod flat;
mod gather;
mod mesh;
mod scene;
mod structures;
mod top;
mod trees;

pub use gather::{Casters, gather, gather_moves};
pub use mesh::ShadowRays;
pub use scene::{GirandoleShadows, extract, prepare, start};

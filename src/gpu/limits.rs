//! Limits of uploads: memory of trees, and bytes of new trees in a frame.

use super::GpuLights;
use crate::keys::TreeKey;
use crate::plan::GpuMemory;

impl GpuLights {
    /// Limits the memory that the nodes and lights of trees take on the GPU, in bytes, from the next
    /// upload on; `None`, the default, lifts the limit. Shaders see trees that do not fit as
    /// stand-ins: see [`LightPlanner::set_tree_memory`](crate::plan::LightPlanner::set_tree_memory).
    pub fn set_tree_memory(&mut self, bytes: Option<u64>) {
        self.planner.set_tree_memory(bytes);
    }

    /// Limits the bytes of new trees and of new versions of trees that an upload sends; `None`, the
    /// default, lifts the limit. Until a tree has been sent, shaders see its stand-ins or its older
    /// version: see [`LightPlanner::set_frame_bytes`](crate::plan::LightPlanner::set_frame_bytes).
    pub fn set_frame_bytes(&mut self, bytes: Option<u64>) {
        self.planner.set_frame_bytes(bytes);
    }

    /// Whether shaders see stand-ins of a tree after the last upload.
    pub fn stands_in(&self, tree: TreeKey) -> bool {
        self.planner.stands_in(tree)
    }

    /// Whether shaders do not see the version of a tree that the world had at the last upload. They
    /// see stand-ins, an older version, or nothing of a tree that was never uploaded.
    pub fn is_waiting(&self, tree: TreeKey) -> bool {
        self.planner.is_waiting(tree)
    }

    /// The memory that the buffers of lights take after the last upload. Usage counters, learnt
    /// visibility, and less than a megabyte of other buffers are not counted.
    pub fn memory(&self) -> GpuMemory {
        self.planner.memory()
    }
}

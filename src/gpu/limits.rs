//! What the engine allows uploads to take: memory, and bytes in a frame.

use super::GpuLights;
use crate::keys::TreeKey;
use crate::plan::GpuMemory;

impl GpuLights {
    /// Limits the memory that the nodes and lights of trees take on the GPU, in bytes, from the next
    /// upload on; `None`, as at first, lifts the limit. Trees that do not fit are seen by shaders as
    /// stand-ins: see [`LightPlanner::set_tree_memory`](crate::plan::LightPlanner::set_tree_memory).
    pub fn set_tree_memory(&mut self, bytes: Option<u64>) {
        self.planner.set_tree_memory(bytes);
    }

    /// Limits the bytes of new trees and of new versions of trees that an upload sends; `None`, as at
    /// first, lifts the limit. Until a tree has been sent, shaders see stand-ins or its older version:
    /// see [`LightPlanner::set_frame_bytes`](crate::plan::LightPlanner::set_frame_bytes).
    pub fn set_frame_bytes(&mut self, bytes: Option<u64>) {
        self.planner.set_frame_bytes(bytes);
    }

    /// Whether shaders see stand-ins of a tree after the last upload.
    pub fn stands_in(&self, tree: TreeKey) -> bool {
        self.planner.stands_in(tree)
    }

    /// Whether shaders do not see a tree as it was at the last upload: they see stand-ins, an older
    /// version, or nothing of a tree that was never uploaded.
    pub fn is_waiting(&self, tree: TreeKey) -> bool {
        self.planner.is_waiting(tree)
    }

    /// The memory that the buffers of lights take after the last upload. Not counted: usage counters,
    /// learnt visibility, and less than a megabyte of others.
    pub fn memory(&self) -> GpuMemory {
        self.planner.memory()
    }
}

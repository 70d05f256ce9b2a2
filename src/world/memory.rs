//! The memory that a world takes.

use super::region_view::RegionView;
use super::scene::Scene;
use super::{LightWorld, TreeEntry};
use crate::keys::InstanceKey;
use crate::tree::{LightTree, Opening, TreeMemory};

/// The memory of a [`LightWorld`](crate::LightWorld) on the heap of the CPU, in bytes: the capacities
/// of its arrays times the sizes of their elements.
///
/// Not counted is what is comparatively small or short-lived: builds that are under way (about 150
/// bytes per light, and the tree that they make), the partition of the top level (about 150 bytes for each part of
/// an instance), the top level that the CPU samples, the lists
/// of the scheduler, and the overhead of the allocator. Each removed light counts as 4 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WorldMemory {
    /// The parts of all trees.
    pub trees: TreeMemory,
    /// Results of builds in slices or in the background that replace their trees in the next
    /// update.
    pub successors: usize,
    /// Edits of lights that wait for the next update, and the logs of changes for uploads. A tree
    /// of more than eight lights that was edited keeps this memory until it is frozen.
    pub edits: usize,
    /// The lists of the instances and openings of each tree, and the lists of regions.
    pub lists: usize,
    /// The tables of all trees, instances and regions, and the log of their changes. They grow with
    /// the largest numbers so far, and never shrink.
    pub tables: usize,
}

impl WorldMemory {
    /// The sum of all parts.
    pub fn total(&self) -> usize {
        self.trees.total() + self.successors + self.edits + self.lists + self.tables
    }
}

impl LightWorld {
    /// The memory that the world takes on the heap of the CPU, by use. O(trees), about 10 ns for each.
    ///
    /// Once all instances, regions and trees have been removed, everything but the tables is 0.
    pub fn memory(&self) -> WorldMemory {
        let Scene { trees, instances, .. } = &self.scene;
        let regions = size_of::<(u64, RegionView)>() * (self.regions.capacity() + 1);
        let mut memory = WorldMemory {
            tables: trees.memory_bytes() + instances.memory_bytes() + regions + self.log.memory_bytes(),
            lists: self.regions.values().map(RegionView::memory_bytes).sum(),
            ..WorldMemory::default()
        };
        for TreeEntry { tree, successor, staged, log, instances, openings, births, .. } in trees.values() {
            memory.trees.add(&tree.memory());
            memory.successors +=
                successor.as_ref().map_or(0, |built| size_of::<LightTree>() + built.tree.memory_bytes());
            memory.edits += staged.memory_bytes() + log.memory_bytes();
            memory.lists += size_of::<InstanceKey>() * instances.capacity()
                + size_of::<Opening>() * openings.len()
                + births.lights.memory_bytes();
        }
        memory
    }
}

//! The memory that a world takes.

use crate::tree::TreeMemory;

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

    pub(super) fn add(&mut self, other: &Self) {
        self.trees.add(&other.trees);
        self.successors += other.successors;
        self.edits += other.edits;
        self.lists += other.lists;
    }

    pub(super) fn remove(&mut self, other: &Self) {
        self.trees.remove(&other.trees);
        self.successors -= other.successors;
        self.edits -= other.edits;
        self.lists -= other.lists;
    }
}

//! The memory that a world takes, kept up to date by every change.

use super::{Instance, LightWorld, TreeEntry};
use crate::keys::{InstanceKey, TreeKey};
use crate::tree::{Section, TreeMemory};

/// The memory of a [`LightWorld`] on the heap of the CPU, in bytes: the capacities of its arrays
/// times the sizes of their elements.
///
/// Not counted is what is comparatively small or short-lived: builds that are under way (about 150
/// bytes per light, and the tree that they make), the top level that the CPU samples, the grids in
/// which overlaps of instances are found, the lists of the scheduler, and the
/// overhead of the allocator. Each removed light counts as 4 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WorldMemory {
    /// The parts of all trees.
    pub trees: TreeMemory,
    /// Results of builds in slices or in the background that replace their trees in the next
    /// update.
    pub successors: usize,
    /// Edits of lights that wait for the next update, and the logs of changes for uploads. A tree
    /// that was edited keeps this memory until it is frozen.
    pub edits: usize,
    /// The lists of the instances and sections of each tree, and the lists of regions.
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

    fn add(&mut self, other: &Self) {
        self.trees.add(&other.trees);
        self.successors += other.successors;
        self.edits += other.edits;
        self.lists += other.lists;
    }

    fn remove(&mut self, other: &Self) {
        self.trees.remove(&other.trees);
        self.successors -= other.successors;
        self.edits -= other.edits;
        self.lists -= other.lists;
    }
}

/// The terms of one tree in the sums over all trees, or these sums.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counted {
    memory: WorldMemory,
    pub placeholders: usize,
}

impl TreeEntry {
    /// A slot map has a version beside each record.
    const RECORD_BYTES: usize = size_of::<(u64, Self)>();

    /// The present terms of this tree in the sums.
    fn present_count(&self) -> Counted {
        let memory = WorldMemory {
            trees: self.tree.memory(),
            successors: self.successor.as_ref().map_or(0, |tree| size_of_val(&**tree) + tree.memory_bytes()),
            edits: self.staged.memory_bytes() + self.log.memory_bytes(),
            lists: size_of::<InstanceKey>() * self.instances.capacity()
                + size_of::<Section>() * self.sections.capacity(),
            tables: 0,
        };
        Counted { memory, placeholders: usize::from(self.tree.is_placeholder()) }
    }
}

impl Instance {
    const RECORD_BYTES: usize = size_of::<Option<(InstanceKey, Self)>>();
}

impl Counted {
    fn add(&mut self, other: &Self) {
        self.memory.add(&other.memory);
        self.placeholders += other.placeholders;
    }

    /// Subtracts what was added.
    pub fn remove(&mut self, other: &Self) {
        self.memory.remove(&other.memory);
        self.placeholders -= other.placeholders;
    }

    /// Adds or removes bytes of the lists of regions.
    pub fn change_lists(&mut self, former: usize, present: usize) {
        self.memory.lists = self.memory.lists - former + present;
    }
}

impl LightWorld {
    /// The memory that the world takes on the heap of the CPU, by use. O(1): the sums follow every
    /// change.
    ///
    /// Once all instances, regions and trees have been removed, everything but the tables is 0.
    pub fn memory(&self) -> WorldMemory {
        // A slot map has one slot that it never uses.
        let trees = (self.trees.capacity() + 1) * TreeEntry::RECORD_BYTES;
        let instances = self.instances.capacity() * Instance::RECORD_BYTES;
        let keys = (self.instances.key_capacity() + 1) * size_of::<u64>();
        let slots = self.tree_slots.capacity() * size_of::<Option<TreeKey>>() + self.log.memory_bytes();
        let tables = trees + instances + keys + slots;
        WorldMemory { tables: tables + self.regions.memory_bytes(), ..self.counted.memory }
    }

    /// Brings the sums over all trees up to date with a tree that changed. O(1).
    pub(super) fn recount(&mut self, tree: TreeKey) {
        let entry = &mut self.trees[tree];
        let former = std::mem::take(&mut entry.counted);
        let present = entry.present_count();
        entry.counted = present;
        self.counted.remove(&former);
        self.counted.add(&present);
    }
}

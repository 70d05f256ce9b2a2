//! Sums over all trees of a world, kept up to date by every change.

use super::memory::WorldMemory;

/// The terms of one tree in the sums over all trees, or these sums.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    pub memory: WorldMemory,
    pub placeholders: usize,
    /// The lights of each tree once per instance.
    pub lights: usize,
    /// The sections of each tree once per instance.
    pub sections: usize,
}

impl Sums {
    /// Replaces the terms of a tree by others. O(1).
    pub fn replace(&mut self, former: &Self, present: &Self) {
        self.remove(former);
        self.memory.add(&present.memory);
        self.placeholders += present.placeholders;
        self.lights += present.lights;
        self.sections += present.sections;
    }

    /// Subtracts the terms of a tree.
    pub fn remove(&mut self, former: &Self) {
        self.memory.remove(&former.memory);
        self.placeholders -= former.placeholders;
        self.lights -= former.lights;
        self.sections -= former.sections;
    }

    /// Adds or removes bytes of the lists of regions.
    pub fn change_lists(&mut self, former: usize, present: usize) {
        self.memory.lists = self.memory.lists - former + present;
    }
}

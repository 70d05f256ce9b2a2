//! Sums over all trees of a world, kept up to date by every change.

use super::memory::WorldMemory;

/// The terms of one tree in the sums over all trees, or these sums.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    pub memory: WorldMemory,
    pub placeholders: usize,
    /// The lights of each tree once per instance.
    pub lights: usize,
    /// The lights of each tree once.
    pub stored_lights: usize,
    pub instances: usize,
    /// The openings that crowds call for, once per instance.
    pub wanted_openings: usize,
    /// The parts of all instances.
    pub parts: usize,
    /// Instances of opened trees.
    pub opened: usize,
    /// Instances of trees that are whole because all openings would be too many.
    pub held_back: usize,
}

impl Sums {
    /// Replaces the terms of a tree by others. O(1).
    pub fn replace(&mut self, former: &Self, present: &Self) {
        self.remove(former);
        self.memory.add(&present.memory);
        self.counts().into_iter().zip(present.clone().counts()).for_each(|(sum, term)| *sum += *term);
    }

    /// Subtracts the terms of a tree.
    pub fn remove(&mut self, former: &Self) {
        self.memory.remove(&former.memory);
        self.counts().into_iter().zip(former.clone().counts()).for_each(|(sum, term)| *sum -= *term);
    }

    fn counts(&mut self) -> [&mut usize; 8] {
        let Self { placeholders, lights, stored_lights, instances, wanted_openings, parts, opened, held_back, .. } =
            self;
        [placeholders, lights, stored_lights, instances, wanted_openings, parts, opened, held_back]
    }

    /// Adds or removes bytes of the lists of regions.
    pub fn change_lists(&mut self, former: usize, present: usize) {
        self.memory.lists = self.memory.lists - former + present;
    }
}

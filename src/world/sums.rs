//! Sums over all trees of a world, kept up to date by every change.

use super::memory::WorldMemory;
use crate::tree::TreeMemory;

/// The sums over all trees.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    pub memory: WorldMemory,
    /// The lights of each tree once per instance.
    pub lights: usize,
    /// The lights of each tree once.
    pub stored_lights: usize,
    pub instances: usize,
    /// The parts of all instances.
    pub parts: usize,
    /// Instances of opened trees.
    pub opened: usize,
    /// Instances of crowded trees that are not loose because all openings would be too many.
    pub held_back: usize,
}

/// What the terms of one tree in these sums follow from.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TreeTerms {
    pub memory: TreeMemory,
    /// The bytes of the result of a build, of edits and their log, and of lists.
    pub successor: usize,
    pub edits: usize,
    pub lists: usize,
    pub lights: u32,
    pub instances: u32,
    /// Of each instance.
    pub openings: u32,
    pub is_held_back: bool,
}

impl TreeTerms {
    fn sums(&self) -> Sums {
        let Self { memory: trees, successor: successors, edits, lists, .. } = *self;
        let [lights, instances, openings] = [self.lights, self.instances, self.openings].map(|count| count as usize);
        let instances_if = |condition: bool| if condition { instances } else { 0 };
        Sums {
            memory: WorldMemory { trees, successors, edits, lists, tables: 0 },
            lights: lights * instances,
            stored_lights: lights,
            instances,
            parts: openings.max(1) * instances,
            opened: instances_if(openings > 0),
            held_back: instances_if(self.is_held_back),
        }
    }
}

impl Sums {
    /// The openings of all instances.
    pub fn openings(&self) -> usize {
        self.parts + self.opened - self.instances
    }

    /// Replaces the terms of a tree by others. O(1).
    pub fn replace(&mut self, former: &TreeTerms, present: &TreeTerms) {
        self.remove(former);
        let mut present = present.sums();
        self.memory.add(&present.memory);
        self.counts().into_iter().zip(present.counts()).for_each(|(sum, term)| *sum += *term);
    }

    /// Subtracts the terms of a tree.
    pub fn remove(&mut self, former: &TreeTerms) {
        let mut former = former.sums();
        self.memory.remove(&former.memory);
        self.counts().into_iter().zip(former.counts()).for_each(|(sum, term)| *sum -= *term);
    }

    fn counts(&mut self) -> [&mut usize; 6] {
        let Self { lights, stored_lights, instances, parts, opened, held_back, .. } = self;
        [lights, stored_lights, instances, parts, opened, held_back]
    }

    /// Adds or removes bytes of the lists of regions.
    pub fn change_lists(&mut self, former: usize, present: usize) {
        self.memory.lists = self.memory.lists - former + present;
    }
}

//! Sums over all trees of a world, which follow every change.

/// The sums over all trees.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    /// The lights of each tree once per instance.
    pub lights: usize,
    pub instances: usize,
    /// The parts of all instances.
    pub parts: usize,
    /// Instances of opened trees.
    pub opened: usize,
    /// Instances of crowded trees that are not loose because all openings would be too many.
    pub held_back: usize,
    /// Trees whose lights move, and those whose lights kernels write.
    pub moving: usize,
    /// Trees that are not at rest.
    pub awake: usize,
}

/// What the terms of one tree in these sums follow from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TreeTerms {
    pub lights: u32,
    pub instances: u32,
    /// Of each instance.
    pub openings: u32,
    pub moving: u8,
    pub is_awake: bool,
    pub is_held_back: bool,
}

impl TreeTerms {
    fn sums(&self) -> Sums {
        let [lights, instances, openings] = [self.lights, self.instances, self.openings].map(|count| count as usize);
        let instances_if = |condition: bool| if condition { instances } else { 0 };
        Sums {
            lights: lights * instances,
            instances,
            parts: openings.max(1) * instances,
            opened: instances_if(openings > 0),
            held_back: instances_if(self.is_held_back),
            moving: usize::from(self.moving),
            awake: usize::from(self.is_awake),
        }
    }
}

impl Sums {
    /// The openings of all instances.
    pub fn openings(&self) -> usize {
        self.parts + self.opened - self.instances
    }

    /// Adds the terms of a tree.
    pub fn add(&mut self, terms: &TreeTerms) {
        self.all().into_iter().zip(terms.sums().all()).for_each(|(sum, term)| *sum += *term);
    }

    /// Subtracts the terms of a tree.
    pub fn remove(&mut self, terms: &TreeTerms) {
        self.all().into_iter().zip(terms.sums().all()).for_each(|(sum, term)| *sum -= *term);
    }

    fn all(&mut self) -> [&mut usize; 7] {
        let Self { lights, instances, parts, opened, held_back, moving, awake } = self;
        [lights, instances, parts, opened, held_back, moving, awake]
    }
}

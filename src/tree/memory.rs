//! The memory that a tree takes.

use super::LightTree;
use super::node::Node;
use crate::cluster::{Cluster, Linear};
use crate::light::Light;

/// The memory of a tree on the heap, in bytes: the capacities of its arrays times the sizes of
/// their elements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct TreeMemory {
    /// The nodes, and the data that builds record about them.
    pub nodes: usize,
    /// The lights, the places of their leaves, the numbers of lights with effects, and the sets of added
    /// and removed lights.
    pub lights: usize,
    /// The data that only refits need, and that [`LightTree::freeze`] drops.
    pub refits: usize,
}

impl TreeMemory {
    /// The sum of all parts.
    pub fn total(&self) -> usize {
        self.nodes + self.lights + self.refits
    }

    /// Adds another tree.
    pub(crate) fn add(&mut self, other: &Self) {
        self.nodes += other.nodes;
        self.lights += other.lights;
        self.refits += other.refits;
    }
}

impl LightTree {
    /// The memory of the tree on the heap, by use. Each index in a set of removed lights counts as
    /// 4 bytes. O(1).
    pub fn memory(&self) -> TreeMemory {
        let Self { lights, leaves, nodes, state, light_counts, sides, .. } = self;
        let maps = [&self.maps.reference, &self.maps.weights].into_iter().flatten().count();
        let reference = maps * size_of::<Linear>();
        TreeMemory {
            nodes: size_of::<Node>() * nodes.capacity()
                + size_of::<Cluster>() * sides.len()
                + size_of::<u32>() * light_counts.capacity()
                + reference,
            lights: size_of::<Light>() * lights.capacity()
                + size_of::<u32>() * leaves.capacity()
                + self.effects.memory_bytes()
                + self.edited.memory_bytes(),
            refits: state.memory_bytes(),
        }
    }

    /// The sum of all parts of [`LightTree::memory`]. O(1).
    pub fn memory_bytes(&self) -> usize {
        self.memory().total()
    }
}

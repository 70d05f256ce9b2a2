//! Which of the trees that the world opens are opened for shaders too: all of them, unless their parts would
//! not fit into the buffers. Then the trees whose instances have the most parts together are whole.

use super::pool::SPARE;
use crate::world::{LightWorld, TreeEntry};

/// Trees that are held back are opened again once their parts would leave one part in this many of the
/// room free. So few changes of a world near the limit send trees again.
const REOPENING_SPARE: u64 = 4;

/// What the decision depends on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Demand {
    /// The parts of all instances if all trees are opened as in the world.
    parts: usize,
    instances: usize,
    trees: usize,
    /// The parts that fit into the buffers.
    room: u64,
}

/// Which trees are opened for shaders.
#[derive(Clone, Copy, Debug)]
pub(super) struct Opened {
    /// The most parts of all instances of an opened tree together.
    most: u64,
    /// The instances of trees with more.
    held_back: usize,
    demand: Demand,
}

/// The parts that all instances of a tree have together if it is opened. A tree without instances has the
/// records of one.
fn parts_of(entry: &TreeEntry) -> u64 {
    entry.openings.len() as u64 * entry.instances.len().max(1) as u64
}

impl Opened {
    /// All trees.
    pub const ALL: Self =
        Self { most: u64::MAX, held_back: 0, demand: Demand { parts: 0, instances: 0, trees: 0, room: 0 } };

    /// The number of openings of a tree for shaders.
    pub fn openings(&self, entry: &TreeEntry) -> usize {
        if parts_of(entry) <= self.most { entry.openings.len() } else { 0 }
    }

    /// The instances of trees that are opened in the world and whole for shaders.
    pub fn held_back(&self) -> usize {
        self.held_back
    }

    /// The decision for a world whose parts have `room`; `None` if it is the present one. O(1) while all parts
    /// fit, and O(trees · log trees) after a change of the number of parts, instances or trees of a world
    /// whose parts do not.
    pub fn decided(&self, world: &LightWorld, room: u64) -> Option<Self> {
        let (parts, instances, trees) = (world.part_count(), world.instances().len(), world.trees().len());
        let demand = Demand { parts, instances, trees, room };
        if demand == self.demand || self.most == u64::MAX && parts as u64 <= room - room / SPARE {
            return None;
        }
        let entries = world.trees().filter_map(|key| world.tree_entry(key));
        let mut opened: Vec<(u64, usize)> = entries
            .filter(|entry| !entry.openings.is_empty())
            .map(|entry| (parts_of(entry), entry.instances.len()))
            .collect();
        opened.sort_unstable();
        let without_instances: u64 =
            opened.iter().filter(|(_, instances)| *instances == 0).map(|(parts, _)| parts).sum();
        let most_within = |room: u64| {
            let (mut left, mut parts) = (&opened[..], parts as u64 + without_instances);
            let mut closed = u64::MAX;
            while let [before @ .., (largest, instances)] = left
                && (parts > room || *largest == closed)
            {
                parts = parts.saturating_sub(largest - *instances as u64);
                (left, closed) = (before, *largest);
            }
            if closed == u64::MAX { u64::MAX } else { left.last().map_or(0, |(largest, _)| *largest) }
        };
        let [least, next] = [SPARE, REOPENING_SPARE].map(|spare| most_within(room - room / spare));
        let most = least.min(self.most.max(next));
        let held_back = opened.iter().filter(|(parts, _)| *parts > most).map(|(_, instances)| instances).sum();
        Some(Self { most, held_back, demand })
    }
}

//! What a planner remembers between frames, and what it reports.

use std::ops::Range;

use super::layout::TreeRecord;
use crate::keys::TreeKey;
use crate::part::Division;
use crate::tree::LightTree;
use crate::world::{FrameDelta, LightWorld};

/// What a plan sends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct UploadReport {
    /// Bytes that the writes of the plan carry; 0 if nothing changed.
    pub bytes: u64,
    /// Trees of which nodes and lights were written.
    pub trees: usize,
    /// Nodes that were written.
    pub nodes: usize,
    /// Lights of trees that were written.
    pub lights: usize,
    /// Instances whose records were written.
    pub instances: usize,
}

/// The tree of a slot on the GPU, and its ranges of the pools.
#[derive(Clone, Debug)]
pub(super) struct TreeRanges {
    pub key: Option<TreeKey>,
    pub nodes: Range<u32>,
    pub lights: Range<u32>,
    /// One record for each part of an instance of the tree.
    pub records: Range<u32>,
    pub division: Division,
    /// What of the tree was written: see [`ChangeLog`](crate::world::ChangeLog).
    pub revision: u64,
}

impl TreeRanges {
    /// No tree.
    pub const NONE: Self =
        Self { key: None, nodes: 0..0, lights: 0..0, records: 0..0, division: Division::Whole, revision: 0 };

    /// Whether the ranges have room for the nodes, lights and parts of a tree, and not much more.
    pub fn fit(&self, tree: &LightTree, division: Division) -> bool {
        let fits = |range: &Range<u32>, count: usize| (count..=most_room(count)).contains(&range.len());
        fits(&self.nodes, tree.nodes().len())
            && fits(&self.lights, tree.lights().len())
            && self.records.len() == TreeRecord::count(tree, division) as usize
            && self.division == division
    }

    /// The room for numbers of nodes and lights that the ranges do not fit. If either has grown, both
    /// get a quarter more, so that a tree to which lights are added one by one moves within the pools
    /// once for a quarter of its lights.
    pub fn room_for(&self, [nodes, lights]: [usize; 2]) -> [u32; 2] {
        let has_grown = nodes > self.nodes.len() || lights > self.lights.len();
        [nodes, lights].map(|count| if has_grown { count + count / 4 + 16 } else { count } as u32)
    }
}

/// More room than this is given back.
fn most_room(count: usize) -> usize {
    2 * count + 64
}

/// Slots to be written: those of a delta and of the deltas that failed before it, and the slots
/// that change as a consequence.
#[derive(Clone, Debug, Default)]
pub(super) struct PendingChanges {
    pub trees: Slots,
    pub instances: Slots,
    /// Slots of instances whose user data changed.
    pub user_data: Slots,
    pub directionals: bool,
}

/// A set of slots: ascending, each once, after [`Slots::sort`].
#[derive(Clone, Debug, Default)]
pub(super) struct Slots(Vec<u32>);

impl Slots {
    /// Adds slots in any order.
    pub fn extend(&mut self, slots: impl IntoIterator<Item = u32>) {
        self.0.extend(slots);
    }

    /// Brings the slots in order. Linear if they are in order already.
    pub fn sort(&mut self) {
        self.0.sort_unstable();
        self.0.dedup();
    }

    /// The slots, in ascending order if they were sorted.
    pub fn as_slice(&self) -> &[u32] {
        &self.0
    }
}

impl PendingChanges {
    pub fn is_empty(&self) -> bool {
        !self.concern_lights() && self.user_data.as_slice().is_empty()
    }

    /// Whether more changes than user data, so that the top level must be built again.
    pub fn concern_lights(&self) -> bool {
        !self.trees.as_slice().is_empty() || !self.instances.as_slice().is_empty() || self.directionals
    }

    /// The slots of instances whose records change, in ascending order.
    pub fn records(&self) -> Slots {
        let mut records = self.instances.clone();
        if !self.user_data.as_slice().is_empty() {
            records.extend(self.user_data.as_slice().iter().copied());
            records.sort();
        }
        records
    }

    pub fn add(&mut self, delta: &FrameDelta) {
        self.trees.extend(delta.trees.iter().copied());
        self.instances.extend(delta.instances.iter().copied());
        self.user_data.extend(delta.user_data.iter().copied());
        self.directionals |= delta.directionals;
        [&mut self.trees, &mut self.instances, &mut self.user_data].into_iter().for_each(Slots::sort);
    }

    /// Adds all slots, for a device whose records may be undefined. No instance has slot 0, but
    /// shaders may read its record.
    pub fn add_everything(&mut self, world: &LightWorld) {
        self.instances.extend([0].into_iter().filter(|_| world.slot_count() > 0));
        self.add(&FrameDelta::everything(world));
    }
}

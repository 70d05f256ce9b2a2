//! What [`GpuLights::upload`](super::GpuLights::upload) remembers between calls, and what it
//! reports.

use std::collections::BTreeSet;
use std::ops::Range;

use super::layout::TreeRecord;
use crate::keys::TreeKey;
use crate::part::Division;
use crate::tree::LightTree;
use crate::world::{FrameDelta, LightWorld};

/// What [`GpuLights::upload`](super::GpuLights::upload) sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct UploadReport {
    /// Bytes written to buffers; 0 if nothing changed.
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
}

/// The room for a number of nodes or lights that has grown: a quarter more, so that a tree to which
/// lights are added one by one moves within the pools once for a quarter of its lights.
pub(super) fn room(count: usize) -> u32 {
    (count + count / 4 + 16) as u32
}

/// More room than this is given back.
fn most_room(count: usize) -> usize {
    2 * count + 64
}

/// Slots to be written: those of a delta and of the deltas that failed before it, and the slots
/// that change as a consequence.
#[derive(Clone, Debug, Default)]
pub(super) struct PendingChanges {
    pub trees: BTreeSet<u32>,
    pub instances: BTreeSet<u32>,
    /// Slots of instances whose user data changed.
    pub user_data: BTreeSet<u32>,
    pub directionals: bool,
}

impl PendingChanges {
    pub fn is_empty(&self) -> bool {
        !self.concern_lights() && self.user_data.is_empty()
    }

    /// Whether more changes than user data, so that the top level must be built again.
    pub fn concern_lights(&self) -> bool {
        !self.trees.is_empty() || !self.instances.is_empty() || self.directionals
    }

    /// The slots of instances whose records change.
    pub fn records(&self) -> BTreeSet<u32> {
        self.instances.union(&self.user_data).copied().collect()
    }

    pub fn add(&mut self, delta: &FrameDelta) {
        self.trees.extend(&delta.trees);
        self.instances.extend(&delta.instances);
        self.user_data.extend(&delta.user_data);
        self.directionals |= delta.directionals;
    }

    /// Adds all that the world holds. The slots of removed trees and instances stay.
    pub fn add_everything(&mut self, world: &LightWorld) {
        self.add(&FrameDelta::everything(world));
        self.directionals = true;
    }
}

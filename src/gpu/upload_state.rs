//! What [`GpuLights::upload`](super::GpuLights::upload) remembers between calls, and what it
//! reports.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::keys::TreeKey;
use crate::tree::LightTree;
use crate::world::{FrameDelta, LightWorld};

/// What [`GpuLights::upload`](super::GpuLights::upload) sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct UploadReport {
    /// Bytes written to buffers; 0 if nothing changed.
    pub bytes: u64,
    /// Trees whose nodes and lights were written.
    pub trees: usize,
    /// Instances whose records were written.
    pub instances: usize,
}

/// The tree of a slot on the GPU, and its ranges of the pools.
#[derive(Clone, Debug, Default)]
pub(super) struct TreeRanges {
    pub key: Option<TreeKey>,
    pub nodes: Range<u32>,
    pub lights: Range<u32>,
    /// One record for each side of the tree, or one for the whole tree.
    pub records: Range<u32>,
}

impl TreeRanges {
    /// Whether a tree has as many nodes, lights and sides as the ranges.
    pub fn fit(&self, tree: &LightTree) -> bool {
        self.nodes.len() == tree.nodes().len()
            && self.lights.len() == tree.lights().len()
            && self.records.len() == tree.sides().len().max(1)
    }
}

/// Slots to be written: those of a delta and of the deltas that failed before it, and the slots
/// that change as a consequence.
#[derive(Clone, Debug, Default)]
pub(super) struct PendingChanges {
    pub trees: BTreeSet<u32>,
    pub instances: BTreeSet<u32>,
    pub directionals: bool,
}

impl PendingChanges {
    pub fn is_empty(&self) -> bool {
        self.trees.is_empty() && self.instances.is_empty() && !self.directionals
    }

    pub fn add(&mut self, delta: &FrameDelta) {
        self.trees.extend(&delta.trees);
        self.instances.extend(&delta.instances);
        self.directionals |= delta.directionals;
    }

    /// Adds all that the world holds. The slots of removed trees and instances stay.
    pub fn add_everything(&mut self, world: &LightWorld) {
        self.add(&FrameDelta::everything(world));
        self.directionals = true;
    }
}

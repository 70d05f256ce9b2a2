//! What a planner remembers between frames, and what it reports.

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
    /// Trees that wait to be sent whole. Shaders see stand-ins of them, or an older version.
    pub waiting_trees: usize,
    /// Bytes of the nodes and lights of these trees.
    pub waiting_bytes: u64,
    /// Trees of which shaders see stand-ins.
    pub stand_ins: usize,
}

/// Slots to be written: those of a delta and of the deltas that failed before it, and the slots
/// that change as a consequence.
#[derive(Clone, Debug, Default)]
pub(super) struct PendingChanges {
    pub trees: Slots,
    pub instances: Slots,
    pub directionals: bool,
    /// More changed than user data, so that the top level must be built again.
    pub concern_lights: bool,
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
        self.trees.as_slice().is_empty() && self.instances.as_slice().is_empty() && !self.directionals
    }

    pub fn add(&mut self, delta: &FrameDelta) {
        self.trees.extend(delta.trees.iter().copied());
        self.instances.extend(delta.instances.iter().copied());
        self.directionals |= delta.directionals;
        self.concern_lights |= delta.concerns_lights;
        [&mut self.trees, &mut self.instances].into_iter().for_each(Slots::sort);
    }

    /// Adds all slots, for a device whose records may be undefined. No instance has slot 0, but
    /// shaders may read its record.
    pub fn add_everything(&mut self, world: &LightWorld) {
        self.instances.extend([0].into_iter().filter(|_| world.slot_count() > 0));
        self.add(&FrameDelta::everything(world));
    }
}

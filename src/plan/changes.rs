//! What a planner remembers between frames, and what it reports.

use crate::world::{LightWorld, Revision};

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
    /// Instances of trees that the world opens, and of which shaders see one part each, because the parts of
    /// all would not fit into [`PlanLimits::largest_buffer`](super::PlanLimits). Their light is right, and
    /// noisier. They are opened again once there is room.
    pub held_back_instances: usize,
}

/// Slots to be written: those that changed in the world since the last plan, and those that change
/// as a consequence.
#[derive(Clone, Debug, Default)]
pub(super) struct FrameChanges {
    pub trees: Slots,
    pub instances: Slots,
    /// Those of the instances that may have another number of parts.
    pub parts: Slots,
    pub directionals: bool,
    /// The map of the sky is another, or has changed.
    pub sky: bool,
    /// More changed than user data, so that the top level must be built again.
    pub concern_lights: bool,
}

/// A set of slots: ascending, each once, after [`Slots::sort`].
#[derive(Clone, Debug, Default)]
pub(super) struct Slots(Vec<u32>);

impl Slots {
    /// Slots in ascending order, each once.
    fn of(slots: impl Iterator<Item = u32>) -> Self {
        let mut all = Vec::new();
        // Twice as fast as `collect` for these iterators.
        slots.for_each(|slot| all.push(slot));
        Self(all)
    }

    /// Adds slots in any order.
    pub fn extend(&mut self, slots: impl IntoIterator<Item = u32>) {
        self.0.extend(slots);
    }

    /// Brings the slots in order. Linear if they are in order already.
    pub fn sort(&mut self) {
        self.0.sort_unstable();
        self.0.dedup();
    }

    /// Drops the slots from `end` on, of slots in order.
    pub fn cut_to(&mut self, end: u32) {
        self.0.truncate(self.0.partition_point(|slot| *slot < end));
    }

    /// The slots, in ascending order if they were sorted.
    pub fn as_slice(&self) -> &[u32] {
        &self.0
    }
}

impl FrameChanges {
    pub fn is_empty(&self) -> bool {
        self.trees.as_slice().is_empty() && self.instances.as_slice().is_empty() && !self.directionals && !self.sky
    }

    /// What changed since a revision.
    pub fn since(revision: Revision, world: &LightWorld) -> Self {
        let changes = world.changes_since(revision);
        Self {
            trees: Slots::of(changes.trees()),
            instances: Slots::of(changes.instance_records()),
            parts: Slots::of(changes.instance_trees()),
            directionals: changes.directionals(),
            sky: changes.sky(),
            concern_lights: changes.concern_lights(),
        }
    }

    /// Everything, for a device whose records may be undefined. No instance has slot 0, but shaders
    /// may read its record.
    pub fn everything(world: &LightWorld) -> Self {
        let mut all =
            Self { directionals: true, sky: true, concern_lights: true, ..Self::since(Revision::default(), world) };
        all.instances.extend([0].into_iter().filter(|_| world.slot_count() > 0));
        all.instances.sort();
        all
    }
}

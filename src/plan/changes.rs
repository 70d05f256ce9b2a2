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
/// as a consequence. In ascending order, each once.
#[derive(Clone, Debug, Default)]
pub(super) struct FrameChanges {
    pub trees: Vec<u32>,
    pub instances: Vec<u32>,
    /// Those of the instances that may have another number of parts.
    pub parts: Vec<u32>,
    pub directionals: bool,
    /// The map of the sky is another, or has changed.
    pub sky: bool,
    /// More changed than user data, so that the top level must be built again.
    pub concern_lights: bool,
}

/// Slots, in ascending order and each once where these are.
fn list_of(slots: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut all = Vec::new();
    // Twice as fast as `collect` for these iterators.
    slots.for_each(|slot| all.push(slot));
    all
}

/// Brings slots in ascending order, each once. Linear if they are in order already.
pub(super) fn sort(slots: &mut Vec<u32>) {
    slots.sort_unstable();
    slots.dedup();
}

impl FrameChanges {
    pub fn is_empty(&self) -> bool {
        self.trees.is_empty() && self.instances.is_empty() && !self.directionals && !self.sky
    }

    /// What changed since a revision.
    pub fn since(revision: Revision, world: &LightWorld) -> Self {
        let changes = world.changes_since(revision);
        Self {
            trees: list_of(changes.trees()),
            instances: list_of(changes.instance_records()),
            parts: list_of(changes.instance_trees()),
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
        sort(&mut all.instances);
        all
    }
}

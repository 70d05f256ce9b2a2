//! Changes since the last upload to the GPU.

use glam::DVec3;

use super::LightWorld;

/// The changes of a world between two calls of [`LightWorld::take_delta`]: what `GpuLights::upload`
/// sends to a GPU.
///
/// Each list of slots is in ascending order and names each slot once.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameDelta {
    /// Slots of trees that were added, edited, rebuilt or removed.
    pub(crate) trees: Vec<u32>,
    /// Slots of instances that were added, moved, changed or removed.
    pub(crate) instances: Vec<u32>,
    /// Some directional light was added, changed or removed.
    pub(crate) directionals: bool,
    /// More changed than user data, which the top level does not depend on.
    pub(crate) concerns_lights: bool,
    /// Some of `instances`.
    moved: Vec<u32>,
    /// Others of `instances`.
    removed: Vec<u32>,
    origin_shift: Option<DVec3>,
}

impl FrameDelta {
    /// Whether nothing changed, so that an upload of this delta writes no byte.
    pub fn is_empty(&self) -> bool {
        self.trees.is_empty() && self.instances.is_empty() && !self.directionals && self.origin_shift.is_none()
    }

    /// The delta of a whole world, for a GPU that nothing was uploaded to yet, or that missed some
    /// deltas. It contains the slots that are free, because a GPU that missed a removal still has
    /// something there. It names nothing as moved or removed.
    pub fn everything(world: &LightWorld) -> Self {
        // No key has slot 0.
        let all = |count: usize| (1..count.max(1) as u32).collect();
        Self {
            trees: all(world.tree_slots.len()),
            instances: all(world.instances.slot_count()),
            directionals: true,
            concerns_lights: true,
            ..Self::default()
        }
    }

    /// By how much [`LightWorld::origin`] moved since the last delta, in metres; `None` if it is where
    /// it was. Exact where the origin lies on a grid ([`OriginMode`](crate::OriginMode)).
    ///
    /// Once this delta is uploaded, shaders expect positions relative to the new origin: subtract the
    /// shift from every position that was kept from earlier frames. To ask for probabilities of the
    /// last frame, add it to a present position.
    pub fn origin_shift(&self) -> Option<DVec3> {
        self.origin_shift
    }

    /// The slots of instances that were moved since the last delta, in ascending order, for shaders
    /// that keep samples from frame to frame: the field `instance` of a kept sample is such a slot
    /// ([`LightWorld::slot`]).
    ///
    /// These slots hold the same instance as before, in another place; an instance that was moved
    /// away and back may be among them. Instances that are hidden by a scale of zero, or shown
    /// again, count as moved. Not listed are new instances, those whose appearance or lights
    /// changed, and the change of all positions by a new origin ([`FrameDelta::origin_shift`]).
    pub fn moved_instances(&self) -> &[u32] {
        &self.moved
    }

    /// The slots of instances that were removed since the last delta, in ascending order. A sample
    /// that was kept from before and names such a slot means nothing any more: the slot is free, or
    /// holds another instance.
    ///
    /// Listed are also instances that were both added and removed since then.
    pub fn removed_instances(&self) -> &[u32] {
        &self.removed
    }
}

impl LightWorld {
    /// Returns the changes since the last call. Pass every delta to `GpuLights::upload`: the
    /// changes of a delta that is dropped are not returned again.
    ///
    /// O(what changed), and a look at 8 bytes for each 4096 slots. Allocates nothing if there are no
    /// changes.
    pub fn take_delta(&mut self) -> FrameDelta {
        let present = self.revision();
        let since = std::mem::replace(&mut self.taken, present);
        let changes = self.changes_since(since);
        FrameDelta {
            trees: changes.trees().collect(),
            instances: changes.instance_records().collect(),
            directionals: changes.directionals(),
            concerns_lights: changes.concern_lights(),
            moved: changes.moved_instances().collect(),
            removed: changes.removed_instances().collect(),
            origin_shift: changes.origin_shift(),
        }
    }
}

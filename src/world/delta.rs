//! Changes since the last upload to the GPU.

use glam::DVec3;

use super::LightWorld;
use super::slot_set::SlotSet;

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
    /// Slots of instances whose user data changed, which the top level does not depend on.
    pub(crate) user_data: Vec<u32>,
    /// Some directional light was added, changed or removed.
    pub(crate) directionals: bool,
    /// Some of `instances`.
    moved: Vec<u32>,
    /// Others of `instances`.
    removed: Vec<u32>,
    origin_shift: Option<DVec3>,
}

impl FrameDelta {
    /// Whether nothing changed, so that an upload of this delta writes no byte.
    pub fn is_empty(&self) -> bool {
        self.trees.is_empty()
            && self.instances.is_empty()
            && self.user_data.is_empty()
            && !self.directionals
            && self.origin_shift.is_none()
    }

    /// The delta of a whole world, for a GPU that nothing was uploaded to yet, or that missed some
    /// deltas. It contains the slots that are free, because a GPU that missed a removal still has
    /// something there. It names nothing as moved or removed.
    pub fn everything(world: &LightWorld) -> Self {
        // No key has slot 0.
        let all = |count: usize| (1..count.max(1) as u32).collect();
        Self {
            trees: all(world.scene.trees.slot_count()),
            instances: all(world.scene.instances.slot_count()),
            directionals: true,
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
    /// An instance that was added and removed since the last delta is not listed, unless an older
    /// one had its slot before.
    pub fn removed_instances(&self) -> &[u32] {
        &self.removed
    }
}

/// Changes that wait for [`LightWorld::take_delta`]. Each slot is kept once, so the memory is
/// bounded by the number of slots even if no delta is ever taken.
#[derive(Debug, Default)]
pub(super) struct Changes {
    trees: SlotSet,
    instances: SlotSet,
    user_data: SlotSet,
    pub directionals: bool,
    /// The origin when the last delta was taken.
    origin: DVec3,
    /// Slots whose instance was moved, and was there when the last delta was taken.
    moved: SlotSet,
    /// Slots whose instance at that time was removed.
    removed: SlotSet,
    /// Slots whose instance was added since.
    added: SlotSet,
    /// Instances that were added, moved, shown, hidden or removed since the last update, for its
    /// report.
    reported: SlotSet,
}

impl Changes {
    /// Records that the tree of a slot was added, edited, rebuilt or removed.
    pub fn tree(&mut self, slot: u32) {
        self.trees.insert(slot);
    }

    /// Records that the instance record of a slot is stale on the GPU.
    pub fn instance(&mut self, slot: u32) {
        self.instances.insert(slot);
    }

    /// Records that the user data of the instance in a slot changed.
    pub fn user_data(&mut self, slot: u32) {
        self.user_data.insert(slot);
    }

    /// Records that the instance of a slot was shown or hidden, or got another tree.
    pub fn reported(&mut self, slot: u32) {
        self.instance(slot);
        self.reported.insert(slot);
    }

    /// Records that an instance was added in a slot.
    pub fn added(&mut self, slot: u32) {
        self.reported(slot);
        self.added.insert(slot);
    }

    /// Records that the instance of a slot was moved.
    pub fn moved(&mut self, slot: u32) {
        self.reported(slot);
        if !self.added.contains(slot) {
            self.moved.insert(slot);
        }
    }

    /// Records that the instances of some slots were moved.
    pub fn all_moved(&mut self, slots: &SlotSet) {
        let none = SlotSet::default();
        self.instances.extend(slots, &none);
        self.reported.extend(slots, &none);
        self.moved.extend(slots, &self.added);
    }

    /// Records that the instance of a slot was removed.
    pub fn removed(&mut self, slot: u32) {
        self.reported(slot);
        self.moved.remove(slot);
        if !self.added.remove(slot) {
            self.removed.insert(slot);
        }
    }

    /// Returns how many instances were added, moved, shown, hidden or removed since the last call.
    pub fn take_reported(&mut self) -> usize {
        self.reported.clear()
    }

    fn take(&mut self, origin: DVec3) -> FrameDelta {
        self.added.clear();
        let shift = origin - std::mem::replace(&mut self.origin, origin);
        FrameDelta {
            trees: self.trees.take(),
            instances: self.instances.take(),
            user_data: self.user_data.take(),
            directionals: std::mem::take(&mut self.directionals),
            moved: self.moved.take(),
            removed: self.removed.take(),
            origin_shift: (shift != DVec3::ZERO).then_some(shift),
        }
    }
}

impl LightWorld {
    /// Returns the changes since the last call. Pass every delta to `GpuLights::upload`: the
    /// changes of a delta that is dropped are not returned again.
    ///
    /// O(what changed), and a look at 8 bytes for each 4096 slots. Allocates one list for each kind
    /// of change, and nothing if there are no changes.
    pub fn take_delta(&mut self) -> FrameDelta {
        self.changes.take(self.origin())
    }
}

//! Changes since the last upload to the GPU.

use super::LightWorld;
use crate::keys::slot_of;

/// The changes of a world between two calls of [`LightWorld::take_delta`]: what `GpuLights::upload`
/// sends to a GPU.
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
}

impl FrameDelta {
    /// Whether nothing changed, so that an upload of this delta writes no byte.
    pub fn is_empty(&self) -> bool {
        self.trees.is_empty() && self.instances.is_empty() && self.user_data.is_empty() && !self.directionals
    }

    /// The delta of a whole world, for a GPU that nothing was uploaded to yet.
    pub fn everything(world: &LightWorld) -> Self {
        Self {
            trees: world.trees.keys().map(slot_of).collect(),
            instances: world.instances.keys().map(slot_of).collect(),
            user_data: Vec::new(),
            directionals: !world.directionals.is_empty(),
        }
    }
}

/// Changes that wait for [`LightWorld::take_delta`]. Each slot is kept once, so the memory is
/// bounded by the number of slots even if no delta is ever taken.
#[derive(Debug, Default)]
pub(crate) struct Changes {
    trees: SlotSet,
    instances: SlotSet,
    user_data: SlotSet,
    /// Instances that were added, moved, shown, hidden or removed since the last update, for its
    /// report.
    moved: SlotSet,
    pub directionals: bool,
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

    /// Records that the instance of a slot was added, moved, shown, hidden or removed.
    pub fn moved(&mut self, slot: u32) {
        self.instance(slot);
        self.moved.insert(slot);
    }

    /// Returns how many instances were added, moved, shown, hidden or removed since the last call.
    pub fn take_moved(&mut self) -> usize {
        self.moved.clear()
    }

    fn take(&mut self) -> FrameDelta {
        FrameDelta {
            trees: self.trees.take(),
            instances: self.instances.take(),
            user_data: self.user_data.take(),
            directionals: std::mem::take(&mut self.directionals),
        }
    }
}

/// A set of slots in the order of insertion.
#[derive(Debug, Default)]
struct SlotSet {
    slots: Vec<u32>,
    contains: Vec<bool>,
}

impl SlotSet {
    fn insert(&mut self, slot: u32) {
        let index = slot as usize;
        if self.contains.len() <= index {
            self.contains.resize(index + 1, false);
        }
        if !std::mem::replace(&mut self.contains[index], true) {
            self.slots.push(slot);
        }
    }

    /// Empties the set and returns how many slots it held.
    fn clear(&mut self) -> usize {
        self.slots.iter().for_each(|slot| self.contains[*slot as usize] = false);
        let count = self.slots.len();
        self.slots.clear();
        count
    }

    /// Empties the set and returns its slots.
    fn take(&mut self) -> Vec<u32> {
        self.slots.iter().for_each(|slot| self.contains[*slot as usize] = false);
        std::mem::take(&mut self.slots)
    }
}

impl LightWorld {
    /// Returns the changes since the last call. Pass every delta to `GpuLights::upload`: the
    /// changes of a delta that is dropped are not returned again. Allocates nothing if there are
    /// none.
    pub fn take_delta(&mut self) -> FrameDelta {
        self.changes.take()
    }
}

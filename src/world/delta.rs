//! What changed since the GPU was last told.

use super::LightWorld;
use crate::keys::slot_of;

/// What [`LightWorld::take_delta`] hands over: enough for `GpuLights::upload` to bring a GPU up to date.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameDelta {
    /// Slots whose tree was added, edited, rebuilt or removed.
    pub(crate) trees: Vec<u32>,
    /// Slots whose instance was added, moved or removed.
    pub(crate) instances: Vec<u32>,
    /// Directional lights were added, changed or removed.
    pub(crate) directionals: bool,
}

impl FrameDelta {
    /// Nothing changed: an upload of it writes no byte.
    pub fn is_empty(&self) -> bool {
        self.trees.is_empty() && self.instances.is_empty() && !self.directionals
    }

    /// All there is, for a GPU that has seen nothing yet.
    pub fn everything(world: &LightWorld) -> Self {
        Self {
            trees: world.trees.keys().map(slot_of).collect(),
            instances: world.instances.keys().map(slot_of).collect(),
            directionals: !world.directionals.is_empty(),
        }
    }
}

/// Collects changes, each once however often it happens: what nobody takes stays bounded by the number of slots.
#[derive(Debug, Default)]
pub(crate) struct Changes {
    trees: SlotSet,
    instances: SlotSet,
    /// Instances since the last update, for its report.
    moved: SlotSet,
    pub directionals: bool,
}

impl Changes {
    pub fn tree(&mut self, slot: u32) {
        self.trees.insert(slot);
    }

    /// Its record on the GPU is stale.
    pub fn instance(&mut self, slot: u32) {
        self.instances.insert(slot);
    }

    /// It was added, moved or removed.
    pub fn moved(&mut self, slot: u32) {
        self.instance(slot);
        self.moved.insert(slot);
    }

    /// How many instances were added, moved or removed since the last call.
    pub fn take_moved(&mut self) -> usize {
        self.moved.clear()
    }

    fn take(&mut self) -> FrameDelta {
        FrameDelta {
            trees: self.trees.take(),
            instances: self.instances.take(),
            directionals: std::mem::take(&mut self.directionals),
        }
    }
}

/// A set of small numbers that remembers the order of insertion.
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

    /// Empties the set and says how many it held.
    fn clear(&mut self) -> usize {
        self.slots.iter().for_each(|slot| self.contains[*slot as usize] = false);
        let count = self.slots.len();
        self.slots.clear();
        count
    }

    fn take(&mut self) -> Vec<u32> {
        self.slots.iter().for_each(|slot| self.contains[*slot as usize] = false);
        std::mem::take(&mut self.slots)
    }
}

impl LightWorld {
    /// Hands over what changed since the last call; empty, and without allocation, if nothing did.
    pub fn take_delta(&mut self) -> FrameDelta {
        self.changes.take()
    }
}

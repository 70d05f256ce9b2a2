//! What changed since the GPU was last told.

use super::World;
use crate::keys::slot_of;

/// What [`World::take_delta`] hands over: enough for `GpuLights::upload` to bring a GPU up to date.
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
    pub fn everything(world: &World) -> Self {
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
    trees: Vec<u32>,
    instances: Vec<u32>,
    pub directionals: bool,
    tree_marks: Marks,
    instance_marks: Marks,
}

impl Changes {
    pub fn tree(&mut self, slot: u32) {
        if self.tree_marks.set(slot) {
            self.trees.push(slot);
        }
    }

    pub fn instance(&mut self, slot: u32) {
        if self.instance_marks.set(slot) {
            self.instances.push(slot);
        }
    }

    fn take(&mut self) -> FrameDelta {
        self.trees.iter().for_each(|slot| self.tree_marks.clear(*slot));
        self.instances.iter().for_each(|slot| self.instance_marks.clear(*slot));
        FrameDelta {
            trees: std::mem::take(&mut self.trees),
            instances: std::mem::take(&mut self.instances),
            directionals: std::mem::take(&mut self.directionals),
        }
    }
}

/// A set of small numbers.
#[derive(Debug, Default)]
struct Marks(Vec<bool>);

impl Marks {
    /// True if the number was not in the set.
    fn set(&mut self, number: u32) -> bool {
        let number = number as usize;
        if self.0.len() <= number {
            self.0.resize(number + 1, false);
        }
        !std::mem::replace(&mut self.0[number], true)
    }

    fn clear(&mut self, number: u32) {
        self.0[number as usize] = false;
    }
}

impl World {
    /// Hands over what changed since the last call; empty, and without allocation, if nothing did.
    pub fn take_delta(&mut self) -> FrameDelta {
        self.changes.take()
    }
}

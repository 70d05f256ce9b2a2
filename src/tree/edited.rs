//! What additions and removals of lights have changed in a tree since it was built.

use std::collections::BTreeSet;

use crate::rare::{HasEmpty, Rare};

/// What additions and removals have changed since the last build.
#[derive(Clone, Debug, Default)]
pub(super) struct Edited {
    /// The indices that have no light.
    vacant: BTreeSet<u32>,
    /// The nodes that removals and rebuilt subtrees have left spare. A build leaves none.
    pub free: BTreeSet<u32>,
    /// For each node the number of lights below it when it was made. Empty before the first
    /// addition.
    pub built_lights: Vec<u32>,
    /// Lights whose leaves have moved. In no order; a light may occur several times.
    pub moved: Vec<u32>,
    /// Lights were added or removed since the last build.
    pub is_changed: bool,
}

impl Edited {
    /// The state of a tree that was just built.
    pub fn of_build(vacant: BTreeSet<u32>) -> Rare<Self> {
        if vacant.is_empty() { Rare::default() } else { Self { vacant, ..Self::default() }.into() }
    }

    pub fn vacant(&self) -> &BTreeSet<u32> {
        &self.vacant
    }

    /// Records whether an index has no light.
    pub fn set_vacant(&mut self, index: u32, is_vacant: bool) {
        if is_vacant {
            self.vacant.insert(index);
        } else {
            self.vacant.remove(&index);
        }
    }

    /// Whether lights were added or removed since the last build.
    pub fn is_changed(&self) -> bool {
        self.is_changed
    }

    /// Prepares for an addition to a tree with these numbers of lights below its nodes.
    pub fn will_add(&mut self, light_counts: &[u32]) {
        self.is_changed = true;
        if self.built_lights.is_empty() {
            self.built_lights.extend_from_slice(light_counts);
        }
    }

    /// Records the number of lights below a node that was just made.
    pub fn was_built(&mut self, node: usize, lights: u32) {
        if let Some(built) = self.built_lights.get_mut(node) {
            *built = lights;
        }
    }

    /// Takes the first free node after another node. `None` if there is none: the new node is then
    /// appended.
    pub fn take_node_after(&mut self, node: usize) -> Option<usize> {
        let free = *self.free.range(node as u32 + 1..).next()?;
        self.free.remove(&free);
        Some(free as usize)
    }
}

impl HasEmpty for Edited {
    const EMPTY: &'static Self = &Self {
        vacant: BTreeSet::new(),
        free: BTreeSet::new(),
        built_lights: Vec::new(),
        moved: Vec::new(),
        is_changed: false,
    };

    /// Entries of sets count as numbers.
    fn owned_bytes(&self) -> usize {
        let Self { vacant, free, built_lights, moved, .. } = self;
        size_of::<u32>() * (vacant.len() + free.len()) + built_lights.owned_bytes() + moved.owned_bytes()
    }
}

/// Makes room in a full list for an eighth more entries: doubling would double the memory of a large
/// tree for its first new light.
pub(super) fn make_room<T>(list: &mut Vec<T>) {
    if list.len() == list.capacity() {
        list.reserve_exact(list.len() / 8 + 16);
    }
}

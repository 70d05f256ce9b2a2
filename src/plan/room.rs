//! What a frame changes, found out before anything is written.

use std::collections::BTreeMap;

use super::changes::FrameChanges;
use super::residency::TreeState;
use super::tree_writes::TreeWrite;
use crate::world::LightWorld;

/// What a frame changes, as far as it was found out before anything is written.
pub(super) struct Frame<'a> {
    pub world: &'a LightWorld,
    pub changes: FrameChanges,
    pub trees: TreeFrame,
}

/// The trees that a frame places, and what it writes of them.
#[derive(Debug, Default)]
pub(super) struct TreeFrame {
    /// Bytes of new trees that may still be sent.
    pub left: u64,
    /// The former states of the trees whose place or form changes, by slot.
    pub placed: BTreeMap<u32, TreeState>,
    pub writes: Vec<TreeWrite>,
}

impl TreeFrame {
    /// Whether a tree is among those that the frame places, or among `changed` ones, in order.
    pub fn has(&self, changed: &[u32], slot: u32) -> bool {
        self.placed.contains_key(&slot) || changed.binary_search(&slot).is_ok()
    }
}

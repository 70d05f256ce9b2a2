//! Trees at rest: a tree whose lights stop changing no longer counts as moving, and later it is frozen.
//!
//! Each update looks at some trees in turn. Lists of the trees that are due, by the time of their last change, were
//! exact in large worlds too, for 150 lines and 48 bytes for each tree.

use super::delta::Delta;
use super::rest::RestState;
use super::{LightWorld, TreeEntry};
use crate::effects::EFFECT_HOLD_UPDATES;
use crate::keys::TreeKey;

/// The slots of trees that an update looks at.
const LOOKS_PER_UPDATE: u32 = 256;

/// The most trees that are frozen in one update: freeing their memory takes time, and many trees may be due at once.
const MAX_FREEZES: usize = 64;

impl LightWorld {
    /// Lets the time at rest of a tree that is not frozen any more start again, though no light has changed. O(1).
    pub(super) fn wake(&mut self, tree: TreeKey) {
        self.scene.trees[tree].rest.wake(&self.rest);
    }

    /// Notes that the lights of a tree have changed, which thaws it. O(1).
    pub(super) fn has_moved(&mut self, tree: TreeKey) {
        self.scene.trees[tree].rest.has_moved(&self.rest);
    }

    /// Counts one update, and looks at some trees: those whose lights have not changed for long enough no longer count
    /// as moving, and later they are frozen. O(1).
    pub(super) fn let_rest(&mut self) {
        self.rest.updates += 1;
        if self.sums.awake == 0 {
            return;
        }
        let slots = self.scene.trees.slot_count() as u32;
        let mut freezes_left = MAX_FREEZES;
        for _ in 0..slots.min(LOOKS_PER_UPDATE) {
            self.rest.slot = (self.rest.slot + 1) % slots;
            let Some(key) = self.scene.trees.key_at(self.rest.slot) else { continue };
            let TreeEntry { tree, staged, rest, .. } = &mut self.scene.trees[key];
            let (delay, still) = (u64::from(EFFECT_HOLD_UPDATES), self.rest.updates - rest.since);
            if rest.is_awake() && still > delay << rest.doublings && freezes_left > 0 {
                rest.state = RestState::Frozen;
                freezes_left -= 1;
                let dropped = (tree.freeze_into(), std::mem::take(staged));
                self.rebuilds.long_builder.free(dropped, tree.nodes().len());
            } else if rest.is_moving() && still > delay {
                rest.state = RestState::Still;
            } else {
                continue;
            }
            self.record(Delta::Counts(key));
        }
    }
}

//! Trees at rest: a tree whose lights stop changing no longer counts as moving, and later it is
//! frozen.

use super::LightWorld;
use super::staged::StagedLights;
use crate::effects::{EFFECT_HOLD_UPDATES, Effects};
use crate::keys::TreeKey;

/// The most trees that are frozen in one update: freeing their memory takes time, and many trees
/// may be due at once.
const MAX_FREEZES: usize = 64;

/// The most updates without a change after which a tree is frozen: 64 times the first delay, two
/// minutes at 60 frames a second.
///
/// Without a limit, a tree whose lamps flicker now and then would keep the memory that freezing
/// frees for ever. At the limit, a tree is thawed at most once in 7,680 updates. A thaw computes
/// every node once, as a refit of all lights does, which is then a small share of the time of those
/// updates.
const MAX_FREEZE_DELAY: u32 = 64 * EFFECT_HOLD_UPDATES;

/// How long a tree has been at rest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rest {
    /// The tree counts as moving: its lights changed within the last [`EFFECT_HOLD_UPDATES`]
    /// updates.
    is_moving: bool,
    /// Updates since the lights changed or the tree was added, thawed or rebuilt.
    still_updates: u32,
    /// The tree is frozen once `still_updates` exceeds this. Doubles with each edit of the frozen
    /// tree, up to [`MAX_FREEZE_DELAY`], so that a large tree with a lamp that flickers now and
    /// then is not thawed each time.
    freeze_delay: u32,
}

impl Default for Rest {
    fn default() -> Self {
        Self { is_moving: false, still_updates: 0, freeze_delay: EFFECT_HOLD_UPDATES }
    }
}

impl LightWorld {
    /// Records that a tree is not frozen. If it was, its time at rest starts again.
    pub(super) fn wake(&mut self, tree: TreeKey) {
        if self.awake.insert(tree) {
            self.trees[tree].rest.still_updates = 0;
        }
    }

    /// Records that the lights of a tree have changed, which thaws it.
    pub(super) fn has_moved(&mut self, tree: TreeKey) {
        let rest = &mut self.trees[tree].rest;
        if !self.awake.contains(tree) {
            rest.freeze_delay = (2 * rest.freeze_delay).min(MAX_FREEZE_DELAY);
        }
        rest.still_updates = 0;
        if !std::mem::replace(&mut rest.is_moving, true) {
            self.effects.change(|counts| counts.add(Effects::MOVING));
        }
        self.wake(tree);
    }

    /// Records that a tree is frozen or about to be removed. O(1).
    pub(super) fn let_rest(&mut self, tree: TreeKey) {
        self.stop_moving(tree);
        self.awake.remove(tree);
    }

    /// Records that a tree does not count as moving any more.
    fn stop_moving(&mut self, tree: TreeKey) {
        if std::mem::take(&mut self.trees[tree].rest.is_moving) {
            self.effects.change(|counts| counts.remove(Effects::MOVING));
        }
    }

    /// Counts one update for all trees that are not frozen, and freezes the trees that have been
    /// at rest for long enough. O(trees that are not frozen).
    pub(super) fn freeze_resting(&mut self) {
        let mut frozen = 0;
        // From the last to the first: the tree that takes the index of a removed one has been
        // visited before.
        for index in (0..self.awake.keys().len()).rev() {
            let tree = self.awake.keys()[index];
            let entry = &mut self.trees[tree];
            // Without threads large trees are rebuilt in parts, which needs the data that freezing
            // drops.
            let is_needed = self.schedule.builder.is_unavailable() && entry.rebuild_state.waiting.is_some();
            let rest = &mut entry.rest;
            rest.still_updates = rest.still_updates.saturating_add(1);
            let Rest { still_updates, freeze_delay, .. } = *rest;
            if still_updates > freeze_delay && frozen < MAX_FREEZES && !is_needed {
                frozen += 1;
                entry.tree.freeze();
                entry.staged = StagedLights::default();
                self.let_rest(tree);
            } else if still_updates > EFFECT_HOLD_UPDATES {
                self.stop_moving(tree);
            }
        }
    }
}

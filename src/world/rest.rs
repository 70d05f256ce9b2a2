//! Which trees move and which rest: those that rest are frozen.

use super::LightWorld;
use crate::effects::{EFFECT_HOLD_UPDATES, Effects};
use crate::keys::TreeKey;

/// Trees that are frozen in one update: to give memory back takes time too, and many trees may come at once.
const MAX_FREEZES: usize = 64;

/// A tree's part in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rest {
    /// Its place in the world's list of trees that are awake, if it is.
    place: Option<usize>,
    /// Its lights changed less than [`EFFECT_HOLD_UPDATES`] updates ago.
    is_moving: bool,
    /// Updates since its lights changed, or since it came.
    still: u32,
    /// Updates of stillness after which it is frozen. Twice as many after each thaw, so that a large tree one of whose
    /// lamps flickers now and then is not computed anew each time.
    patience: u32,
}

impl Default for Rest {
    fn default() -> Self {
        Self { place: None, is_moving: false, still: 0, patience: EFFECT_HOLD_UPDATES }
    }
}

impl LightWorld {
    /// A tree has what refits need; its rest begins, if it has not yet.
    pub(super) fn wake(&mut self, tree: TreeKey) {
        let place = self.awake.len();
        let rest = &mut self.trees[tree].rest;
        if rest.place.is_none() {
            rest.place = Some(place);
            rest.still = 0;
            self.awake.push(tree);
        }
    }

    /// A tree's lights have changed.
    pub(super) fn has_moved(&mut self, tree: TreeKey) {
        let rest = &mut self.trees[tree].rest;
        if rest.place.is_none() {
            rest.patience = rest.patience.saturating_mul(2);
        }
        rest.still = 0;
        if !std::mem::replace(&mut rest.is_moving, true) {
            self.effects.change(|counts| counts.add(Effects::MOVING));
        }
        self.wake(tree);
    }

    /// A tree is no longer awake, nor moving. O(1).
    pub(super) fn let_rest(&mut self, tree: TreeKey) {
        self.stand_still(tree);
        let Some(place) = self.trees[tree].rest.place.take() else { return };
        self.awake.swap_remove(place);
        if let Some(moved) = self.awake.get(place) {
            self.trees[*moved].rest.place = Some(place);
        }
    }

    /// A tree does not move any more.
    fn stand_still(&mut self, tree: TreeKey) {
        if std::mem::take(&mut self.trees[tree].rest.is_moving) {
            self.effects.change(|counts| counts.remove(Effects::MOVING));
        }
    }

    /// An update has passed. O(trees that are awake).
    pub(super) fn freeze_resting(&mut self) {
        let mut frozen = 0;
        // From the last on: who takes the place of one that leaves has had its turn.
        for place in (0..self.awake.len()).rev() {
            let tree = self.awake[place];
            let rest = &mut self.trees[tree].rest;
            rest.still = rest.still.saturating_add(1);
            let (still, patience) = (rest.still, rest.patience);
            if still > EFFECT_HOLD_UPDATES {
                self.stand_still(tree);
            }
            // Without threads large trees are rebuilt in parts, which needs what a frozen tree has not.
            let is_needed = self.schedule.builder.is_unavailable() && self.trees[tree].rebuild_state.waiting.is_some();
            if still > patience && frozen < MAX_FREEZES && !is_needed {
                frozen += 1;
                self.trees[tree].tree.freeze();
                self.let_rest(tree);
            }
        }
    }
}

//! Trees at rest: a tree whose lights stop changing no longer counts as moving, and later it is
//! frozen.

use super::LightWorld;
use super::rest_timers::MAX_FREEZES;
use crate::effects::Effects;
use crate::keys::TreeKey;

impl LightWorld {
    /// Records that a tree is not frozen. If it is new or was frozen, its time at rest starts
    /// again. O(1).
    pub(super) fn wake(&mut self, tree: TreeKey) {
        self.rest_timers.wake(tree);
    }

    /// Records that the lights of a tree have changed, which thaws it. O(1).
    pub(super) fn has_moved(&mut self, tree: TreeKey) {
        if self.rest_timers.has_moved(tree) {
            self.effects.change(|counts| counts.add(Effects::MOVING));
        }
    }

    /// Records that a tree is about to be removed. O(1).
    pub(super) fn remove_rest_timer(&mut self, tree: TreeKey) {
        if self.rest_timers.remove(tree) {
            self.effects.change(|counts| counts.remove(Effects::MOVING));
        }
    }

    /// Counts one update, and freezes trees that have been at rest for long enough.
    /// O(trees that come to rest), up to a limit per update.
    pub(super) fn freeze_resting(&mut self) {
        let stopped = self.rest_timers.count_update();
        if stopped > 0 {
            self.effects.change(|counts| (0..stopped).for_each(|_| counts.remove(Effects::MOVING)));
        }
        for _ in 0..MAX_FREEZES {
            let Some(tree) = self.rest_timers.take_due() else { break };
            let entry = &mut self.scene.trees[tree];
            let dropped = (entry.tree.freeze_into(), std::mem::take(&mut entry.staged));
            entry.recount(&mut self.sums);
            self.rebuilds.long_builder.free(dropped, entry.tree.nodes().len());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scheduler::FrameBudget;
    use crate::tree::LightTree;

    #[test]
    fn an_update_in_which_nothing_moved_visits_as_few_trees_of_100_000_as_of_one() {
        let accesses = [1, 100_000].map(|count| {
            let mut world = LightWorld::new();
            let trees: Vec<_> =
                (0..count).map(|_| world.add_tree(LightTree::new(Vec::new()).expect("valid"))).collect();
            for tree in trees.iter().step_by(2) {
                world.replace_lights(*tree, Vec::new()).expect("valid");
            }
            world.update(FrameBudget::NONE);
            world.rest_timers.take_accesses();
            for _ in 0..100 {
                world.update(FrameBudget::NONE);
            }
            assert_eq!(world.rest_timers.awake_count(), count);
            assert_eq!(world.effect_counts().of(Effects::MOVING), count.div_ceil(2) as u64);
            world.rest_timers.take_accesses()
        });
        assert_eq!(accesses[0], accesses[1]);
    }
}

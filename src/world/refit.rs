//! Brings trees up to date with the edits since the last update, in parallel.

use super::LightWorld;
use crate::effects::EffectCounts;
use crate::keys::{TreeKey, slot_of};
use crate::light::Light;
use crate::policy::AttributeHistory;
use crate::scheduler::{Replacement, TreeFeatures};
use crate::tree::LightTree;

impl LightWorld {
    /// How many trees, and lights in them.
    pub(super) fn refit_edited(&mut self) -> (usize, usize) {
        if self.edited.is_empty() {
            return (0, 0);
        }
        // Trees leave the map while threads work on them; a moved-from tree is empty and costs nothing.
        let edited = std::mem::take(&mut self.edited);
        let mut work: Vec<Edited> = edited
            .into_iter()
            .map(|key| {
                let entry = &mut self.trees[key];
                entry.is_edited = false;
                Edited {
                    key,
                    former: *entry.tree.effects(),
                    tree: std::mem::take(&mut entry.tree),
                    staged: std::mem::take(&mut entry.staged),
                    successor: entry.rebuild_state.successor.take(),
                    succeeded: None,
                    has_moved: false,
                    is_measured: entry.may_rebuild(),
                }
            })
            .collect();
        let refit = |Edited { tree, staged, has_moved, successor, succeeded, is_measured, .. }: &mut Edited| {
            if let Some(built) = successor.take() {
                let replaced = Replacement { before: TreeFeatures::of(tree), after: TreeFeatures::of(&built) };
                let history = AttributeHistory::start(built.attributes());
                *succeeded = Some((replaced, history, tree.succeed(*built)));
            }
            *has_moved = !staged.is_empty();
            tree.apply(staged);
            if *is_measured {
                tree.refit();
            } else {
                tree.refit_without_attributes();
            }
            staged.clear();
        };
        #[cfg(feature = "parallel")]
        {
            use rayon::prelude::*;
            work.par_iter_mut().for_each(refit);
        }
        #[cfg(not(feature = "parallel"))]
        work.iter_mut().for_each(refit);

        let count = (work.len(), work.iter().map(|edited| edited.tree.lights().len()).sum());
        for Edited { key, former, tree, staged, succeeded, has_moved, .. } in work {
            if *tree.effects() != former {
                self.effects.change(|counts| {
                    counts.add_all(tree.effects());
                    counts.remove_all(&former);
                });
            }
            if has_moved {
                self.has_moved(key);
            } else {
                self.wake(key);
            }
            let entry = &mut self.trees[key];
            entry.tree = tree;
            entry.staged = staged;
            let mut is_new = false;
            if let Some((replaced, history, is_outdated)) = succeeded {
                is_new = !is_outdated && !has_moved;
                entry.rebuild_state.learn(&replaced, None, self.schedule.frame);
                entry.history = history;
            }
            if entry.may_rebuild() {
                entry.record_change(self.schedule.frame);
            }
            if is_new {
                // Not even those that always rebuild want more.
                self.withdraw_request(key);
            } else {
                self.update_request(key);
            }
            self.changes.tree(slot_of(key));
        }
        self.top.take();
        count
    }
}

/// A tree that left the map to be refitted.
struct Edited {
    key: TreeKey,
    /// What its lights called for before the edits.
    former: EffectCounts,
    tree: LightTree,
    staged: Vec<(u32, Light)>,
    /// Takes its place, if it was built anew in the background.
    successor: Option<Box<LightTree>>,
    /// What that changed, over about the same lights, and whether some of them have moved since.
    succeeded: Option<(Replacement, AttributeHistory, bool)>,
    /// Its lights were edited.
    has_moved: bool,
    /// Some policy reads the attributes.
    is_measured: bool,
}

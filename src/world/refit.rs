//! Brings trees up to date with the edits since the last update, in parallel.

use super::World;
use crate::effects::EffectCounts;
use crate::keys::{TreeKey, slot_of};
use crate::light::Light;
use crate::policy::History;
use crate::scheduler::{Replaced, Signs};
use crate::tree::LightTree;

impl World {
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
                    successor: entry.standing.successor.take(),
                    succeeded: None,
                    is_measured: entry.may_rebuild(),
                }
            })
            .collect();
        let refit = |Edited { tree, staged, successor, succeeded, is_measured, .. }: &mut Edited| {
            if let Some(built) = successor.take() {
                let replaced = Replaced { before: Signs::of(tree), fresh: Signs::of(&built) };
                *succeeded = Some((replaced, History::start(built.attributes())));
                tree.succeed(*built);
            }
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
        for Edited { key, former, tree, staged, succeeded, .. } in work {
            if *tree.effects() != former {
                self.effects.change(|counts| {
                    counts.add_all(tree.effects());
                    counts.remove_all(&former);
                });
            }
            self.has_moved(key);
            let entry = &mut self.trees[key];
            entry.tree = tree;
            entry.staged = staged;
            if let Some((replaced, history)) = succeeded {
                entry.standing.learn(&replaced, None, self.schedule.frame);
                entry.history = history;
            }
            if entry.may_rebuild() {
                entry.has_changed(self.schedule.frame);
            }
            self.judge(key);
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
    /// What that changed, over about the same lights.
    succeeded: Option<(Replaced, History)>,
    /// Some policy reads the attributes.
    is_measured: bool,
}

//! One frame's work on the trees: refit what was edited, decide, rebuild what the budget allows.

use std::time::Duration;

use super::{TreeEntry, World};
use crate::effects::EffectCounts;
use crate::error::WorldError;
use crate::keys::{TreeKey, slot_of};
use crate::light::Light;
use crate::policy::{History, Policy, wants_rebuild};
use crate::scheduler::{FrameBudget, Job, Work, WorkKind, rank};
use crate::tree::LightTree;

/// What [`World::update`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameReport {
    /// Instances added, moved or removed since the last update, each once.
    pub moved_instances: usize,
    /// Trees refitted because their lights changed.
    pub refit_trees: usize,
    /// Lights of these trees.
    pub refit_lights: usize,
    /// Trees rebuilt.
    pub rebuilt_trees: usize,
    /// Trees that ask for a rebuild and must wait for a later frame.
    pub waiting_trees: usize,
    /// What rebuilds were allowed to take.
    pub budget: Duration,
    /// What rebuilds took.
    pub spent: Duration,
    /// What refits took; they are not optional.
    pub refit_time: Duration,
}

impl World {
    /// Brings trees up to date with the edits since the last call. O(lights of edited trees), and O(1) for each tree
    /// that was edited or added lately. To be called once a frame: what has not been called for or not changed for
    /// [`DAMPING`](crate::DAMPING) calls leaves [`World::effects`], and trees give up what only refits need
    /// ([`LightTree::freeze`]).
    ///
    /// Edited trees are refitted, in parallel. Those whose policy asks for a rebuild are then rebuilt, the most
    /// worthwhile first, as long as the predicted time of the next one fits into what is left of the budget.
    pub fn update(&mut self, budget: FrameBudget) -> FrameReport {
        let mut report =
            FrameReport { moved_instances: self.changes.take_moved(), budget: budget.time(), ..FrameReport::default() };
        let start = self.clock.now();
        (report.refit_trees, report.refit_lights) = self.refit_edited();
        if report.refit_trees > 0 {
            self.clock.worked(Work { kind: WorkKind::Refit, lights: report.refit_lights });
        }
        report.refit_time = self.clock.now().saturating_sub(start);
        self.rebuild_waiting(budget, &mut report);
        self.effects.fade();
        self.freeze_resting();
        report
    }

    /// How many trees, and lights in them.
    fn refit_edited(&mut self) -> (usize, usize) {
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
                    is_measured: entry.may_rebuild(),
                }
            })
            .collect();
        let refit = |Edited { tree, staged, is_measured, .. }: &mut Edited| {
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
        for Edited { key, former, tree, staged, .. } in work {
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
            let now = entry.tree.attributes();
            entry.history.observe(&now);
            let wants = entry.policies.iter().any(|(policy, _)| wants_rebuild(policy, &entry.history, &now));
            if wants && !entry.is_waiting {
                entry.is_waiting = true;
                entry.waited = 0;
                self.waiting.push(key);
            }
            self.changes.tree(slot_of(key));
        }
        self.top.take();
        count
    }

    fn rebuild_waiting(&mut self, budget: FrameBudget, report: &mut FrameReport) {
        if self.waiting.is_empty() {
            return;
        }
        let mut jobs: Vec<Job<TreeKey>> = self.waiting.iter().map(|key| job(*key, &self.trees[*key])).collect();
        rank(&mut jobs, &self.cost_model);
        self.waiting.clear();
        for Job { key, lights, .. } in jobs {
            let entry = &mut self.trees[key];
            // Meanwhile its instances may have changed their minds, or gone.
            if !entry.may_rebuild() {
                entry.is_waiting = false;
                continue;
            }
            if report.spent.saturating_add(self.cost_model.predict(lights)) > budget.time() {
                entry.waited = entry.waited.saturating_add(1);
                self.waiting.push(key);
                continue;
            }
            report.spent += self.rebuild(key);
            report.rebuilt_trees += 1;
        }
        report.waiting_trees = self.waiting.len();
        if report.rebuilt_trees > 0 {
            self.top.take();
        }
    }
}

impl World {
    /// Builds a tree anew at once, whatever its policies say and outside of any budget: for engines that know better,
    /// at a cut between scenes say. Staged changes still wait for the next [`World::update`]. Returns what it took.
    ///
    /// # Errors
    /// [`WorldError::NoSuchTree`]. O(n log n).
    pub fn rebuild_tree(&mut self, tree: TreeKey) -> Result<Duration, WorldError> {
        if !self.trees.contains_key(tree) {
            return Err(WorldError::NoSuchTree(tree));
        }
        if self.trees[tree].is_waiting {
            self.waiting.retain(|key| *key != tree);
        }
        let took = self.rebuild(tree);
        self.top.take();
        Ok(took)
    }

    fn rebuild(&mut self, key: TreeKey) -> Duration {
        let entry = &mut self.trees[key];
        let lights = entry.tree.lights().len();
        let start = self.clock.now();
        entry.tree.rebuild();
        self.clock.worked(Work { kind: WorkKind::Rebuild, lights });
        let took = self.clock.now().saturating_sub(start);
        self.cost_model.learn(lights, took);
        entry.history = History::start(entry.tree.attributes());
        entry.is_waiting = false;
        self.changes.tree(slot_of(key));
        self.wake(key);
        took
    }
}

/// A tree that left the map to be refitted.
struct Edited {
    key: TreeKey,
    /// What its lights called for before the edits.
    former: EffectCounts,
    tree: LightTree,
    staged: Vec<(u32, Light)>,
    /// Some policy reads the attributes.
    is_measured: bool,
}

fn job(key: TreeKey, entry: &TreeEntry) -> Job<TreeKey> {
    let flux = entry.tree.flux();
    let shown = entry.instances.len() as f32;
    Job {
        key,
        first: entry.policies.iter().any(|(policy, _)| *policy == Policy::AlwaysRebuild),
        gain: entry.history.worsening(&entry.tree.attributes()) * (flux.punctual + flux.area) * shown,
        lights: entry.tree.lights().len(),
        waited: entry.waited,
    }
}

//! Brings trees up to date with the edits since the last update, in parallel.

use super::LightWorld;
use super::change_log::ChangeLog;
use super::delta::Delta;
use super::reports::FrameReport;
use super::scene::Successor;
use super::staged::StagedLights;
use crate::effects::EffectCounts;
use crate::keys::TreeKey;
use crate::light::Light;
use crate::policy::AttributeHistory;
use crate::rare::Rare;
use crate::scheduler::{TreeFeatures, Work, WorkKind};
use crate::span::span;
use crate::tree::{LightTree, Refitted};

/// Trees that are moved out of the map at once. A job holds its tree by value, and more: the jobs of a
/// million trees at once would take hundreds of megabytes.
const TREES_AT_ONCE: usize = 4096;

/// Empties the list of staged lights after an update, and keeps its memory for the next edits of a tree
/// of more than one node.
fn clear(staged: &mut Rare<StagedLights>, tree: &LightTree) {
    if tree.nodes().len() <= 1 {
        staged.take();
    } else if staged.memory_bytes() > 0 {
        staged.clear();
    }
}

impl LightWorld {
    /// Refits the trees whose lights changed or that were built in slices or in the background, and
    /// updates the rebuild requests of those and of the trees with a new policy.
    pub(super) fn refit_edited(&mut self, report: &mut FrameReport) {
        let start = self.rebuilds.clock.now();
        self.edits.added.clear();
        self.edits.removed.clear();
        let mut pending = std::mem::take(&mut self.edits.pending);
        pending.retain(|tree| self.scene.trees.contains_key(*tree));
        for trees in pending.chunks(TREES_AT_ONCE) {
            self.refit_trees(trees, report);
        }
        if report.refit_trees > 0 {
            self.rebuilds.clock.worked(Work { kind: WorkKind::Refit, lights: report.refit_lights });
        }
        report.refit_time = self.rebuilds.clock.now().saturating_sub(start);
    }

    /// Refits some of these trees.
    fn refit_trees(&mut self, trees: &[TreeKey], report: &mut FrameReport) {
        span!("refit");
        let mut jobs = self.take_jobs(trees);
        #[cfg(feature = "parallel")]
        {
            use rayon::prelude::*;
            jobs.par_iter_mut().for_each(RefitJob::run);
        }
        #[cfg(not(feature = "parallel"))]
        jobs.iter_mut().for_each(RefitJob::run);

        for job in jobs {
            if job.changes_nodes() {
                report.refit_trees += 1;
                report.refit_lights += job.tree.light_count();
                report.refit_nodes += job.done.nodes;
            }
            self.finish_refit(job);
        }
    }

    /// Moves pending trees out of the map, so that threads can work on them. The trees that stay
    /// behind are empty and cost nothing.
    fn take_jobs(&mut self, pending: &[TreeKey]) -> Vec<RefitJob> {
        let trees = &mut self.scene.trees;
        let job = |key: &TreeKey| {
            let key = *key;
            let entry = &mut trees[key];
            entry.is_pending = false;
            let successor = entry.successor.take();
            let has_new_policy = std::mem::take(&mut entry.requests.has_new_policy);
            // Otherwise all edits were taken back.
            let is_needed = !entry.staged.is_empty() || successor.is_some() || has_new_policy;
            if !is_needed {
                clear(&mut entry.staged, &entry.tree);
            }
            is_needed.then(|| RefitJob {
                key,
                is_edited: !entry.staged.is_empty(),
                is_measured: entry.may_rebuild(),
                before: TreeBefore { effects: *entry.tree.effects(), lights: entry.tree.light_count() },
                tree: std::mem::take(&mut entry.tree),
                staged: std::mem::take(&mut entry.staged),
                log: std::mem::take(&mut entry.log),
                successor,
                done: RefitDone::default(),
            })
        };
        pending.iter().filter_map(job).collect()
    }

    /// Moves a tree back into the map and updates its rebuild request.
    fn finish_refit(&mut self, job: RefitJob) {
        let (changes_nodes, is_as_built) = (job.changes_nodes(), job.is_as_built());
        let RefitJob { key, is_edited, before, tree, staged, log, done, .. } = job;
        let RefitDone { swap, features, added, removed, former, .. } = done;
        if let Some(former) = former {
            let nodes = former.nodes().len();
            self.rebuilds.long_builder.free(former, nodes);
        }
        let (is_thawed, is_replaced) = (!tree.is_frozen(), swap.is_some());
        let entry = &mut self.scene.trees[key];
        entry.tree = tree;
        entry.staged = staged;
        entry.log = log;
        if !added.is_empty() {
            entry.births.lights.add(&added, entry.tree.lights().len(), self.scene.births.next());
        }
        let lights = entry.tree.light_count();
        let have_leaves_moved = !entry.tree.moved_leaves().is_empty();
        if lights != before.lights {
            self.rebuilds.scheduler.was_resized(key, lights);
        }
        if let Some(Swap { features, history, .. }) = swap {
            self.rebuilds.scheduler.was_rebuilt(key, features);
            entry.requests.history = history;
        }
        if let Some(features) = features {
            entry.requests.history.observe(&entry.tree.attributes());
            self.rebuilds.scheduler.has_changed(key, &features);
        }
        if is_edited {
            self.has_moved(key);
        } else if is_thawed {
            self.wake(key);
        }
        if is_as_built {
            // No policy requests more than a tree that was just built, not even
            // `Policy::AlwaysRebuild`.
            self.rebuilds.scheduler.withdraw(key);
        } else {
            self.rebuilds.update_request(key, &mut self.scene);
        }
        if changes_nodes {
            self.record(Delta::Tree(key, &before.effects));
            if is_replaced {
                self.open_replaced(key)
            } else if !added.is_empty() || !removed.is_empty() || have_leaves_moved {
                self.open(key)
            }
        } else {
            self.record(Delta::Counts(key));
        }
        self.edits.added.extend(added.into_iter().map(|light| (key, light)));
        self.edits.removed.extend(removed.into_iter().map(|light| (key, light)));
    }
}

/// A tree that was moved out of the map.
struct RefitJob {
    key: TreeKey,
    /// Lights are staged.
    is_edited: bool,
    /// Some policy needs the attributes.
    is_measured: bool,
    before: TreeBefore,
    tree: LightTree,
    staged: Rare<StagedLights>,
    log: ChangeLog,
    /// The tree that was built in slices or in the background and replaces this one.
    successor: Option<Successor>,
    done: RefitDone,
}

/// A tree before the edits.
struct TreeBefore {
    effects: EffectCounts,
    lights: usize,
}

/// What a job did.
#[derive(Default)]
struct RefitDone {
    /// The nodes that were refitted.
    nodes: usize,
    /// The tree that was replaced.
    former: Option<LightTree>,
    /// What the replacement changed.
    swap: Option<Swap>,
    /// What the scheduler predicts noise from, if some policy needs it and it has changed.
    features: Option<TreeFeatures>,
    /// The lights that the edits add and remove.
    added: Vec<u32>,
    removed: Vec<u32>,
}

/// The replacement of a tree by one that was built in slices or in the background, over about the
/// same lights.
struct Swap {
    /// The features of the new tree as it was built.
    features: TreeFeatures,
    /// The attributes of the new tree as it was built.
    history: AttributeHistory,
    /// Some lights have changed since they were copied for the build.
    is_outdated: bool,
}

impl RefitJob {
    /// Whether the tree's nodes change, so that it counts as refitted and is uploaded.
    fn changes_nodes(&self) -> bool {
        self.is_edited || self.successor.is_some() || self.done.swap.is_some()
    }

    /// Whether the tree was replaced and its lights have not changed since they were copied.
    fn is_as_built(&self) -> bool {
        self.done.swap.as_ref().is_some_and(|swap| !swap.is_outdated) && !self.is_edited
    }

    fn run(&mut self) {
        let before = self.tree.attributes();
        if let Some(Successor { tree: built, since }) = self.successor.take() {
            let features = TreeFeatures::of(&built);
            let history = AttributeHistory::start(built.attributes());
            let changed = self.log.since(since).map(|changes| changes.lights);
            let (former, is_outdated) = self.tree.succeed(*built, changed);
            self.done.former = Some(former);
            self.done.swap = Some(Swap { features, history, is_outdated });
        }
        self.tree.forget_refitted();
        self.list_added_and_removed();
        let former_indices = self.tree.lights().len();
        let is_rebuilt = self.tree.apply(self.staged.changes());
        if is_rebuilt {
            let features = TreeFeatures::of(&self.tree);
            let history = AttributeHistory::start(self.tree.attributes());
            self.done.swap = Some(Swap { features, history, is_outdated: true });
        }
        if self.is_measured {
            self.tree.refit();
            let is_newly_measured = self.tree.attributes() != before;
            if (self.changes_nodes() || is_newly_measured) && !self.is_as_built() {
                self.done.features = Some(TreeFeatures::of(&self.tree));
            }
        } else if self.changes_nodes() {
            self.tree.refit_without_attributes();
        }
        self.log_changes(former_indices);
        clear(&mut self.staged, &self.tree);
    }

    fn list_added_and_removed(&mut self) {
        for (index, light) in self.staged.changes() {
            let was_removed = self.tree.lights().get(*index as usize).is_none_or(Light::is_removed);
            match (was_removed, light.is_removed()) {
                (true, false) => self.done.added.push(*index),
                (false, true) => self.done.removed.push(*index),
                _ => {}
            }
        }
    }

    /// Counts the nodes that were refitted, and logs them, the lights that were edited and the new
    /// indices. `former_indices` is the number of indices before the edits.
    fn log_changes(&mut self, former_indices: usize) {
        let records = self.tree.nodes().len() + self.tree.lights().len();
        match self.tree.refitted() {
            _ if self.done.swap.is_some() => {
                self.done.nodes = self.tree.nodes().len();
                self.log.restart();
            }
            _ if !self.changes_nodes() => {}
            Refitted::All => {
                self.done.nodes = self.tree.nodes().len();
                self.log.restart();
            }
            Refitted::Some(nodes) => {
                self.done.nodes = nodes.len();
                self.log.add(nodes, self.staged.changes().iter().map(|(light, _)| *light), records);
                self.log.add(&[], self.tree.moved_leaves().iter().copied(), records);
                // Of lights that were added and removed before this update.
                let new = self.tree.lights().get(former_indices..).unwrap_or_default();
                if !new.is_empty() {
                    // The root on the GPU says how many indices there are.
                    self.log.add(&[0], std::iter::empty(), records);
                }
                let new = (former_indices as u32..).zip(new);
                let vacant: Vec<u32> = new.filter(|(_, light)| light.is_removed()).map(|(index, _)| index).collect();
                self.log.add(&[], vacant.into_iter(), records);
            }
        }
    }
}

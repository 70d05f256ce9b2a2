//! The update of a world, once a frame: refits the trees that were edited, then rebuilds trees
//! within the budget.

use std::time::Duration;

use super::LightWorld;
use crate::error::WorldError;
use crate::keys::TreeKey;
use crate::scheduler::{FrameBudget, Work, WorkKind};

/// What [`LightWorld::update`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct FrameReport {
    /// Instances that were added, moved or removed since the last update, each counted once.
    pub moved_instances: usize,
    /// Trees that were refitted because their lights changed.
    pub refit_trees: usize,
    /// Lights of these trees.
    pub refit_lights: usize,
    /// Trees that were rebuilt within the frame.
    pub rebuilt_trees: usize,
    /// Subtrees that were rebuilt within the frame, of trees that need a rebuild in part only.
    pub rebuilt_parts: usize,
    /// Trees that request a rebuild and wait for a later frame, without the tree that is being
    /// built in the background.
    pub waiting_trees: usize,
    /// The longest wait in updates, of the trees that were served in this update and of the trees
    /// that still wait.
    pub longest_wait: u64,
    /// Builds on another thread.
    pub background: BackgroundReport,
    /// The time that rebuilds were allowed to take.
    pub budget: Duration,
    /// The predicted time of the rebuilds that were done.
    pub predicted: Duration,
    /// The measured time of the rebuilds that were done, by the world's clock. [`LightWorld::jobs`]
    /// lists each.
    pub spent: Duration,
    /// The time that the choice among the waiting trees took.
    pub deciding: Duration,
    /// The time by which rebuilds and the choice among them exceeded the budget; 0 if nothing was
    /// rebuilt.
    pub overrun: Duration,
    /// The time that refits took. Refits are not part of the budget.
    pub refit_time: Duration,
}

/// The builds in the background of [`LightWorld::update`]: trees that are too large for a frame,
/// one at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct BackgroundReport {
    /// Builds that were started in this update.
    pub started: usize,
    /// Builds that replaced their tree in this update, after a refit to the present lights.
    pub taken: usize,
    /// Builds that were dropped because their tree was removed, got other lights or changed its
    /// policy meanwhile.
    pub dropped: usize,
    /// Builds in progress, 0 or 1. A build whose lights are still being copied counts.
    pub running: usize,
    /// The time that the finished builds took, on their thread.
    pub spent: Duration,
}

impl LightWorld {
    /// Brings trees up to date with the edits since the last call, and rebuilds trees within a time
    /// budget. Call it once a frame.
    ///
    /// 1. Edited trees are refitted, in parallel.
    /// 2. Trees whose policies request a rebuild are rebuilt, whole or in part. Rebuilds that
    ///    remove the most noise per millisecond go first. The noise that a rebuild removes is
    ///    estimated from the tree's attributes and from earlier rebuilds of the tree. It is
    ///    weighted by the tree's share of the picture ([`LightWorld::record_usage`],
    ///    [`LightWorld::set_viewpoint`]). A rebuild starts only if it will probably end within the
    ///    budget.
    /// 3. One sixteenth of the budget is reserved for the tree that has waited longest. In frames,
    ///    a tree waits at most for 16 times the duration of the rebuilds that were requested before
    ///    its own, divided by the budget. This holds while the budget stays the same and has room
    ///    for the tree. A rebuild of a part ends the wait too.
    /// 4. Trees that are too large for a frame are built on another thread; without the feature
    ///    `parallel`, they are rebuilt in parts.
    /// 5. Effects that nothing in the world had for
    ///    [`EFFECT_HOLD_UPDATES`](crate::effects::EFFECT_HOLD_UPDATES) calls leave
    ///    [`LightWorld::effects`], and trees at rest are frozen
    ///    ([`LightTree::freeze`](crate::LightTree::freeze)).
    ///
    /// Cost besides rebuilds: O(lights of edited trees), and O(1) for each tree that is not frozen.
    pub fn update(&mut self, budget: FrameBudget) -> FrameReport {
        let mut report =
            FrameReport { moved_instances: self.changes.take_moved(), budget: budget.time(), ..FrameReport::default() };
        self.schedule.frame += 1;
        self.take_finished_build(&mut report);
        let start = self.clock.now();
        (report.refit_trees, report.refit_lights) = self.refit_pending();
        if report.refit_trees > 0 {
            self.clock.worked(Work { kind: WorkKind::Refit, lights: report.refit_lights });
        }
        report.refit_time = self.clock.now().saturating_sub(start);
        self.run_jobs(&mut report);
        self.effects.count_update();
        self.freeze_resting();
        report
    }

    /// Rebuilds a tree at once, regardless of its policies and of any budget, for example at a cut
    /// between scenes. Changes of its lights still wait for the next [`LightWorld::update`].
    /// Returns the time that the rebuild took. O(n log n).
    ///
    /// # Errors
    /// [`WorldError::NoSuchTree`].
    pub fn rebuild_tree(&mut self, tree: TreeKey) -> Result<Duration, WorldError> {
        let work = Work { kind: WorkKind::Rebuild, lights: self.entry(tree)?.tree.lights().len() };
        let start = self.clock.now();
        let replaced = self.rebuild_whole(tree);
        self.trees[tree].rebuild_state.learn(&replaced, None, self.schedule.frame);
        self.clock.worked(work);
        let took = self.clock.now().saturating_sub(start);
        self.schedule.costs.learn(work, took);
        self.top.take();
        Ok(took)
    }
}

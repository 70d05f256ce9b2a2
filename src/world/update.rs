//! One frame's work on the trees: refit what was edited, then rebuild what is worth it.

use std::time::Duration;

use super::LightWorld;
use crate::error::WorldError;
use crate::keys::TreeKey;
use crate::scheduler::{FrameBudget, Work, WorkKind};

/// What [`LightWorld::update`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameReport {
    /// Instances added, moved or removed since the last update, each once.
    pub moved_instances: usize,
    /// Trees refitted because their lights changed.
    pub refit_trees: usize,
    /// Lights of these trees.
    pub refit_lights: usize,
    /// Trees rebuilt within the frame.
    pub rebuilt_trees: usize,
    /// Subtrees rebuilt within the frame; of a large tree of which a part went bad.
    pub rebuilt_parts: usize,
    /// Trees that ask for a rebuild and must wait for a later frame. Those that are built in the background do not.
    pub waiting_trees: usize,
    /// The most updates that any tree waited that was served in this one or still waits.
    pub longest_wait: u64,
    /// What is done on another thread.
    pub background: BackgroundReport,
    /// What rebuilds were allowed to take.
    pub budget: Duration,
    /// What they were thought to take, those that were done.
    pub predicted: Duration,
    /// What they took, by the world's clock; [`LightWorld::jobs`] has each.
    pub spent: Duration,
    /// What choosing among those that ask took.
    pub deciding: Duration,
    /// By how much rebuilding and choosing took longer than the budget; 0 if nothing was rebuilt.
    pub overrun: Duration,
    /// What refits took; they are not optional.
    pub refit_time: Duration,
}

/// What was done in the background: for trees too large for a frame, one at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BackgroundReport {
    /// Builds started in this update.
    pub started: usize,
    /// Builds that took the place of their tree, after a refit to the present lights.
    pub taken: usize,
    /// Builds whose tree was removed, got other lights or changed its policy meanwhile.
    pub dropped: usize,
    /// Builds on their way, 0 or 1.
    pub running: usize,
    /// What the builds took that ended, on their thread.
    pub spent: Duration,
}

impl LightWorld {
    /// Brings trees up to date with the edits since the last call. O(lights of edited trees), and O(1) for each tree
    /// that was edited or added lately. To be called once a frame: what has not been called for or not changed for
    /// [`EFFECT_HOLD_UPDATES`](crate::EFFECT_HOLD_UPDATES) calls leaves [`LightWorld::effects`], and trees give up what only refits need
    /// ([`LightTree::freeze`](crate::LightTree::freeze)).
    ///
    /// Edited trees are refitted, in parallel. Those whose policy asks for a rebuild are then rebuilt, whole or in
    /// part, those first that gain most for the time: what a rebuild takes off the noise is told from the tree's
    /// attributes, by what earlier rebuilds of this tree have shown, and counts by how much the tree is seen
    /// ([`LightWorld::record_usage`], [`LightWorld::set_viewpoint`]). Nothing begins that would probably not end within the budget. One
    /// sixteenth of the budget goes to who has waited longest: a tree waits for at most 16 times what those that asked
    /// before it take, divided by the budget, in frames, as long as the budget stays the same and has room for it; a
    /// part that is rebuilt counts as its turn. Trees that fit into no frame are built on another thread.
    pub fn update(&mut self, budget: FrameBudget) -> FrameReport {
        let mut report =
            FrameReport { moved_instances: self.changes.take_moved(), budget: budget.time(), ..FrameReport::default() };
        self.schedule.frame += 1;
        self.take_finished_build(&mut report);
        let start = self.clock.now();
        (report.refit_trees, report.refit_lights) = self.refit_edited();
        if report.refit_trees > 0 {
            self.clock.worked(Work { kind: WorkKind::Refit, lights: report.refit_lights });
        }
        report.refit_time = self.clock.now().saturating_sub(start);
        self.run_jobs(&mut report);
        self.effects.fade();
        self.freeze_resting();
        report
    }

    /// Builds a tree anew at once, whatever its policies say and outside of any budget: for engines that know better,
    /// at a cut between scenes say. Staged changes still wait for the next [`LightWorld::update`]. Returns what it took.
    ///
    /// # Errors
    /// [`WorldError::NoSuchTree`]. O(n log n).
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

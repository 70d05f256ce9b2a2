//! Rebuilds trees within the budget of a frame, in the order of the scheduler.

use std::time::Duration;

use super::LightWorld;
use super::delta::Delta;
use super::rebuilds::Rebuilds;
use super::reports::{FrameReport, JobReport, RebuildState};
use crate::keys::TreeKey;
use crate::policy::AttributeHistory;
use crate::scheduler::{BuildStep, TreeFeatures, WorkKind};
use crate::span::span;

impl LightWorld {
    /// Returns how long ago a tree was built and for how long it has waited for a rebuild, as of
    /// the last [`LightWorld::update`]; `None` for a stale key. O(1).
    pub fn rebuild_state(&self, tree: TreeKey) -> Option<RebuildState> {
        self.scene.trees.contains_key(tree).then(|| RebuildState {
            age: self.rebuilds.scheduler.age_of(tree),
            waited: self.rebuilds.scheduler.wait_of(tree),
        })
    }

    /// Returns the jobs of the last [`LightWorld::update`], in the order in which they were done.
    pub fn jobs(&self) -> &[JobReport] {
        &self.rebuilds.jobs
    }

    /// Allows builds in the background, or forbids them. They are allowed at first.
    ///
    /// A tree that does not fit into the budget of one frame is built in slices over several
    /// frames. If builds in the background are allowed, the frames only copy its lights, and
    /// another thread does the rest. The result is the same tree, sooner; its time counts against
    /// the budgets of frames in either case. Without the feature `parallel`, and where no thread
    /// can be created, all builds stay in frames. A build that already runs goes on.
    pub fn set_background_builds(&mut self, are_allowed: bool) {
        self.rebuilds.long_builder.is_kept_in_frames = !are_allowed;
    }

    /// Does the jobs of a frame.
    pub(super) fn do_jobs(&mut self, report: &mut FrameReport) {
        self.rebuilds.jobs.clear();
        if !self.rebuilds.scheduler.has_jobs() {
            return;
        }
        if let Some(tree) = self.rebuilds.scheduler.tree_in_turn() {
            self.rebuilds.update_request(tree, &mut self.scene);
        }
        let start = self.rebuilds.clock.now();
        self.rebuilds.scheduler.start_jobs(report.budget, start);
        let mut now = start;
        while self.rebuilds.scheduler.next_job(now) {
            now = self.do_job(report);
        }
        let elapsed = self.rebuilds.clock.now().saturating_sub(start);
        report.deciding = elapsed.saturating_sub(report.spent);
        // A frame that only finds out that no job fits is not an overrun.
        report.overrun =
            if self.rebuilds.jobs.is_empty() { Duration::ZERO } else { elapsed.saturating_sub(report.budget) };
        report.longest_wait = report.longest_wait.max(self.rebuilds.scheduler.longest_wait());
        report.waiting_trees = self.rebuilds.scheduler.waiting_trees();
        report.sliced_builds = usize::from(self.rebuilds.long_builder.is_in_frames());
        report.background.running = usize::from(self.rebuilds.long_builder.is_in_background());
    }

    /// Does the job that the scheduler has chosen. Returns the time at the end.
    fn do_job(&mut self, report: &mut FrameReport) -> Duration {
        let begin = self.rebuilds.clock.now();
        for index in 0..self.rebuilds.scheduler.job().len() {
            let step = self.rebuilds.scheduler.job()[index];
            if step.work.kind == WorkKind::Rebuild {
                self.rebuild(step.tree);
                self.rebuilds.clock.worked(step.work);
                report.rebuilt_trees += 1;
            } else {
                self.go_on(&step, report);
            }
        }
        let end = self.rebuilds.clock.now();
        let Rebuilds { scheduler, jobs, .. } = &mut self.rebuilds;
        scheduler.finish_job(end.saturating_sub(begin), |tree, done| report.add_job(jobs, tree, done));
        end
    }

    fn rebuild(&mut self, key: TreeKey) {
        span!("rebuild");
        let entry = &mut self.scene.trees[key];
        entry.tree.rebuild();
        let features = TreeFeatures::of(&entry.tree);
        entry.requests.history = AttributeHistory::start(entry.tree.attributes());
        self.rebuilds.scheduler.was_rebuilt(key, features);
        self.wake(key);
        self.record(Delta::WholeTree(key));
        self.open_replaced(key);
    }

    /// Rebuilds a tree outside of any budget, and returns the time that it took.
    pub(super) fn rebuild_now(&mut self, tree: TreeKey) -> Duration {
        let start = self.rebuilds.clock.now();
        self.rebuild(tree);
        self.cancel_build(tree);
        self.rebuilds.clock.worked(self.rebuilds.scheduler.work_of_rebuild(tree));
        let took = self.rebuilds.clock.now().saturating_sub(start);
        self.rebuilds.scheduler.finish_rebuild_outside(tree, took);
        took
    }

    /// Does a slice of the long build.
    fn go_on(&mut self, step: &BuildStep, report: &mut FrameReport) {
        span!("rebuild");
        let entry = &mut self.scene.trees[step.tree];
        self.rebuilds.go_on(step, entry, report);
        if entry.successor.is_some() {
            // The refit of the next update installs it.
            self.await_update(step.tree);
        }
    }

    /// Passes a build that has ended in the background to its tree, if the clock allows it. The
    /// refit that follows installs it.
    pub(super) fn take_finished_build(&mut self, report: &mut FrameReport) {
        if let Some(tree) = self.rebuilds.take_finished_build(&mut self.scene, report) {
            self.await_update(tree);
        }
    }

    /// Forgets the long build of a tree, and its result.
    pub(super) fn cancel_build(&mut self, tree: TreeKey) {
        drop(self.rebuilds.take_long_build(tree));
        self.scene.trees[tree].successor = None;
    }
}

//! Rebuilds trees within the budget of a frame, in the order of the scheduler.

use std::time::Duration;

use super::LightWorld;
use super::update::FrameReport;
use crate::keys::TreeKey;
use crate::policy::AttributeHistory;
use crate::scheduler::{DoneJob, Job, TreeFeatures, Work};

/// One job of the last [`LightWorld::update`](crate::LightWorld::update): a rebuild, or a slice of
/// a build that takes several frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct JobReport {
    /// The tree that the job was for.
    pub tree: TreeKey,
    /// What was done.
    pub work: Work,
    /// The time that the job was predicted to take.
    pub predicted: Duration,
    /// The time that it took, by the world's clock. Small trees are rebuilt in batches of at most
    /// 20 µs; the time of a batch is divided in proportion to the predicted times.
    pub took: Duration,
    /// The number of updates since the tree requested a rebuild.
    pub waited: u64,
}

/// How long ago a tree was built, and whether it waits for a rebuild: for overlays and statistics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct RebuildState {
    /// The number of updates since the tree was last built, or added.
    pub age: u64,
    /// The number of updates since the tree requested a rebuild that is not done yet; `None` if
    /// it does not wait. A tree waits until its long build, in slices or in the background, ends;
    /// the next update installs that build.
    pub waited: Option<u64>,
}

impl LightWorld {
    /// Returns how long ago a tree was built and for how long it has waited for a rebuild, as of
    /// the last [`LightWorld::update`]; `None` for a stale key. O(1).
    pub fn rebuild_state(&self, tree: TreeKey) -> Option<RebuildState> {
        self.trees
            .contains_key(tree)
            .then(|| RebuildState { age: self.scheduler.age_of(tree), waited: self.scheduler.wait_of(tree) })
    }

    /// Returns the jobs of the last [`LightWorld::update`], in the order in which they were done.
    pub fn jobs(&self) -> &[JobReport] {
        &self.jobs
    }

    /// Does the jobs of a frame.
    pub(super) fn do_jobs(&mut self, report: &mut FrameReport) {
        self.jobs.clear();
        if !self.scheduler.has_jobs() {
            return;
        }
        if let Some(tree) = self.scheduler.tree_in_turn() {
            self.update_request(tree);
        }
        let start = self.clock.now();
        self.scheduler.start_jobs(report.budget, start);
        let mut now = start;
        while let Some(job) = self.scheduler.next_job(now) {
            let begin = self.clock.now();
            now = match job {
                Job::Rebuild => self.rebuild_batch(begin, report),
                Job::Slice { tree, units } => self.go_on(tree, units, begin, report),
            };
        }
        let elapsed = self.clock.now().saturating_sub(start);
        report.deciding = elapsed.saturating_sub(report.spent);
        // A frame that only finds out that no job fits is not an overrun.
        report.overrun = if self.jobs.is_empty() { Duration::ZERO } else { elapsed.saturating_sub(report.budget) };
        report.longest_wait = report.longest_wait.max(self.scheduler.longest_wait());
        report.waiting_trees = self.scheduler.waiting_trees();
        report.background.running = usize::from(self.long_builder.is_in_background());
    }

    /// Rebuilds the trees that the scheduler has chosen. Returns the time at the end.
    fn rebuild_batch(&mut self, begin: Duration, report: &mut FrameReport) -> Duration {
        let count = self.scheduler.batch().len();
        for index in 0..count {
            let tree = self.scheduler.batch()[index].tree;
            self.rebuild(tree);
            self.clock.worked(self.scheduler.work_of_rebuild(tree));
        }
        let end = self.clock.now();
        let Self { scheduler, jobs, .. } = self;
        scheduler.finish_batch(end.saturating_sub(begin), |tree, done| report_job(jobs, tree, done, report));
        report.rebuilt_trees += count;
        end
    }

    fn rebuild(&mut self, key: TreeKey) {
        let entry = &mut self.trees[key];
        let was_divided = !entry.tree.sides().is_empty();
        entry.tree.rebuild();
        let is_divided = !entry.tree.sides().is_empty();
        let features = TreeFeatures::of(&entry.tree);
        entry.history = AttributeHistory::start(entry.tree.attributes());
        self.whole_tree_changed(key);
        self.renew_sections(key);
        self.wake(key);
        self.top.take();
        self.scheduler.was_rebuilt(key, features);
        self.recount(key);
        if is_divided != was_divided {
            // A placeholder is never divided.
            for index in 0..self.trees[key].instances.len() {
                self.judge_later(self.trees[key].instances[index]);
            }
        }
    }

    /// Rebuilds a tree outside of any budget, and returns the time that it took.
    pub(super) fn rebuild_now(&mut self, tree: TreeKey) -> Duration {
        let start = self.clock.now();
        self.rebuild(tree);
        self.cancel_build(tree);
        self.clock.worked(self.scheduler.work_of_rebuild(tree));
        let took = self.clock.now().saturating_sub(start);
        self.scheduler.finish_rebuild_outside(tree, took);
        took
    }
}

/// Adds a job to the list of jobs and to the report.
pub(super) fn report_job(jobs: &mut Vec<JobReport>, tree: TreeKey, done: DoneJob, report: &mut FrameReport) {
    let DoneJob { work, predicted, took, waited } = done;
    jobs.push(JobReport { tree, work, predicted, took, waited });
    report.spent = report.spent.saturating_add(took);
    report.predicted = report.predicted.saturating_add(predicted);
    report.longest_wait = report.longest_wait.max(waited);
}

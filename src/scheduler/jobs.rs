//! The next job of a frame, and what jobs took.

use std::time::Duration;

use super::clock::{Work, WorkKind};
use super::constants::{MAX_CHARGE_RATIO, MAX_PASSED_OVER, MAX_UNSPENT_SHARE, MIN_SLICE_UNITS, SLICE};
use super::cost::{self, CostModel};
use super::ledger::nanos;
use super::requests::whole;
use super::state::{FrameTime, OpenBuild};
use super::{Scheduler, TreeState, Waiting};
use crate::keys::TreeKey;
use crate::tree::{MAX_EXTRA_UNITS, WIDTH, units_of_build};

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Job {
    /// Rebuild a tree at once.
    Rebuild(TreeKey),
    /// Go on with the open build, or begin it, and do at most about this many units of work.
    Slice { tree: TreeKey, units: usize },
}

/// A job that was done.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DoneJob {
    pub work: Work,
    pub predicted: Duration,
    /// Frames since the tree began to wait.
    pub waited: u64,
}

impl Scheduler {
    /// Starts the jobs of a frame, at time `now` of the clock.
    pub fn start_jobs(&mut self, budget: Duration, now: Duration) {
        let smallest_rebuild = self.costs.predict(whole(WIDTH));
        self.time = FrameTime { budget, start: now, min_spent: Duration::ZERO, smallest_rebuild };
    }

    /// Whether there is anything to do or to pay for.
    pub fn has_jobs(&self) -> bool {
        !self.queue.is_empty() || self.open.is_some()
    }

    /// Returns the next job, or `None` at the end of the frame.
    ///
    /// 1. The tree or the open build with the greatest priority comes first.
    /// 2. A tree that fits into the rest of the frame is rebuilt.
    /// 3. A tree that exceeds even the whole budget of the frame is opened: from now on it is built
    ///    in slices. It is passed over if it would fit into a whole frame, or if another build is
    ///    open.
    /// 4. The time that is left at the end goes to the open build. If there is none, the first tree
    ///    that was passed over is opened, unless it is so small that little time is left.
    pub fn next_job(&mut self, now: Duration) -> Option<Job> {
        if self.time.budget.is_zero() {
            return None;
        }
        while self.queue.passed_over() < MAX_PASSED_OVER {
            let left = self.left(now);
            let best = self.queue.best().filter(|index| self.priority(self.queue.rank(*index)) >= 0.0);
            let open = self.open.as_ref().filter(|open| open.is_due()).map(|open| open.rank);
            let Some(index) = best.filter(|index| open.is_none_or(|open| self.queue.rank(*index) > open)) else {
                if open.is_none() || !self.pay() {
                    break;
                }
                // The trees that were passed over because a build was open may be opened now.
                self.restore_passed_over();
                continue;
            };
            let tree = self.queue.tree(index);
            let cost = self.upper_bound(tree);
            if cost <= left {
                return Some(Job::Rebuild(tree));
            }
            if cost > self.time.budget && self.open.is_none() {
                self.open(tree);
            } else if left < self.time.smallest_rebuild {
                break;
            } else {
                self.queue.pass_over(index);
            }
        }
        let min_cost = self.time.budget / MAX_UNSPENT_SHARE;
        let passed_over = self.restore_passed_over().filter(|tree| self.upper_bound(*tree) > min_cost);
        if self.open.is_none() && self.left(now) >= self.costs.upper_bound(smallest_slice(WIDTH)) {
            self.open(passed_over?);
        }
        self.pay();
        self.slice(now)
    }

    /// The time that the rebuild of a tree that waits hardly ever exceeds.
    fn upper_bound(&self, tree: TreeKey) -> Duration {
        let nanos = self.trees[tree].waiting.map_or(0, |waiting| waiting.nanos);
        Duration::from_nanos((nanos as f64 * self.costs.margin(WorkKind::Rebuild)) as u64)
    }

    /// The time that a job may take now.
    fn left(&self, now: Duration) -> Duration {
        self.time.left(now).min(self.ledger.balance())
    }

    fn restore_passed_over(&mut self) -> Option<TreeKey> {
        let Self { queue, trees, .. } = self;
        queue.restore(|tree| trees[tree].waiting.map(|waiting| waiting.index))
    }

    /// Takes a tree out of the queue and opens a build of it.
    fn open(&mut self, tree: TreeKey) {
        let Some(Waiting { index, since_frame, nanos, .. }) = self.trees[tree].waiting else { return };
        let rank = self.queue.rank(index);
        self.withdraw(tree);
        // The tree waits until the build is done and paid for.
        self.waiting_nanos += nanos;
        let TreeState { lights, units, .. } = self.trees[tree];
        let units_left = units as usize;
        self.open = Some(OpenBuild {
            tree: Some(tree),
            rank,
            since_frame,
            nanos,
            lights,
            units_left,
            unpaid: None,
            is_built: false,
        });
    }

    /// The next slice of the open build, if there is time for it.
    fn slice(&self, now: Duration) -> Option<Job> {
        let open = self.open.as_ref().filter(|open| open.unpaid.is_none())?;
        // A slice may take more units than it is given.
        let units = self.costs.units_within(self.left(now).min(SLICE), open.lights).saturating_sub(MAX_EXTRA_UNITS);
        // In frames that are too short for any slice, one is done whenever the ledger has saved up
        // enough for it.
        let is_first = self.time.min_spent.is_zero();
        let is_saved = is_first && self.ledger.balance() >= self.costs.upper_bound(smallest_slice(open.lights));
        let is_enough = units >= MIN_SLICE_UNITS.min(open.units_left) || is_saved;
        is_enough.then_some(Job::Slice { tree: open.tree?, units: units.max(MIN_SLICE_UNITS) })
    }

    /// Pays for the open build in the background, as far as the ledger can. Returns whether nothing
    /// is left to pay for.
    fn pay(&mut self) -> bool {
        let Some(OpenBuild { unpaid: Some(unpaid), .. }) = &mut self.open else { return false };
        *unpaid -= self.ledger.pay(*unpaid);
        let is_paid = *unpaid <= 0.0;
        self.close_if_done();
        is_paid
    }

    /// Closes the open build if it is done and paid for.
    fn close_if_done(&mut self) {
        let is_done = |open: &mut OpenBuild| {
            // A build in the background cannot be stopped.
            let has_ended = open.is_built || (open.tree.is_none() && open.unpaid.is_none());
            has_ended && !open.unpaid.is_some_and(|unpaid| unpaid > 0.0)
        };
        if let Some(open) = self.open.take_if(is_done) {
            self.waiting_nanos -= open.nanos;
        }
    }

    /// The work of a rebuild of a whole tree.
    pub fn work_of_rebuild(&self, tree: TreeKey) -> Work {
        whole(self.trees[tree].lights)
    }

    /// The work of a slice of the open build.
    pub fn work_of_slice(&self, units: usize) -> Work {
        slice_of(self.open.as_ref().map_or(0, |open| open.lights), units)
    }

    /// Records the time of a rebuild in this frame. `waited` is what [`Scheduler::was_rebuilt`] has
    /// returned.
    pub fn finish_rebuild(&mut self, tree: TreeKey, waited: u64, took: Duration) -> DoneJob {
        let TreeState { lights, units, .. } = self.trees[tree];
        self.finish(whole(lights), units, took, waited)
    }

    /// Records the time of a rebuild outside of any budget.
    pub fn finish_rebuild_outside(&mut self, tree: TreeKey, took: Duration) {
        let TreeState { lights, units, .. } = self.trees[tree];
        self.costs.learn(whole(lights), units, took);
    }

    /// Records a slice of the open build: its units, and those that are left.
    pub fn finish_slice(&mut self, units: usize, units_left: usize, took: Duration) -> DoneJob {
        let frame = self.frame;
        let Some(open) = &mut self.open else { return self.finish(smallest_slice(WIDTH), units as f64, took, 0) };
        open.units_left = units_left;
        open.is_built = units_left == 0;
        let (waited, work) = (frame - open.since_frame, slice_of(open.lights, units));
        self.close_if_done();
        self.finish(work, cost::units(work), took, waited)
    }

    fn finish(&mut self, work: Work, units: f64, took: Duration, waited: u64) -> DoneJob {
        let predicted = self.costs.learn(work, units, took);
        self.ledger.charge(took, predicted);
        self.time.min_spent = self.time.min_spent.saturating_add(CostModel::lower_bound(units));
        DoneJob { work, predicted, waited }
    }

    /// Records that the open build goes on in the background, and returns its work. The ledger pays
    /// for the predicted time as it can.
    pub fn go_on_in_background(&mut self) -> Work {
        let lights = self.open.as_ref().map_or(0, |open| open.lights);
        let work = Work { kind: WorkKind::Background, lights };
        let predicted = nanos(self.costs.predict(work));
        if let Some(open) = &mut self.open {
            open.unpaid = Some(predicted);
        }
        work
    }

    /// Records that the build in the background has ended, and corrects its price.
    pub fn finish_background(&mut self, work: Work, took: Duration) {
        let predicted = nanos(self.costs.learn(work, cost::units(work), took));
        let Some(OpenBuild { unpaid: Some(unpaid), is_built, .. }) = &mut self.open else { return };
        // As for other jobs, a machine that was suspended during the build does not pay for hours.
        let due = *unpaid + nanos(took).min(MAX_CHARGE_RATIO * predicted) - predicted;
        *unpaid = due.max(0.0);
        self.ledger.give_back((-due).max(0.0));
        *is_built = true;
        self.close_if_done();
    }

    /// Forgets that a tree needs the open build. What the background does for it must still be paid
    /// for.
    pub fn cancel(&mut self, tree: TreeKey) {
        if let Some(open) = self.open.as_mut().filter(|open| open.tree == Some(tree)) {
            open.tree = None;
            self.close_if_done();
        }
    }

    /// How many frames the tree of the open build has waited.
    pub fn open_wait(&self) -> u64 {
        self.open.as_ref().map_or(0, |open| self.frame - open.since_frame)
    }
}

/// The smallest slice of a build.
fn smallest_slice(tree_lights: usize) -> Work {
    slice_of(tree_lights, MIN_SLICE_UNITS)
}

/// A slice of a build, of some units.
fn slice_of(tree_lights: usize, units: usize) -> Work {
    let units_per_light = units_of_build(tree_lights) / tree_lights.max(1) as f64;
    Work { kind: WorkKind::Slice { tree_lights }, lights: (units as f64 / units_per_light).round().max(1.0) as usize }
}

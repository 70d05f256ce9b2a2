//! The next job of a frame.

use std::time::Duration;

use super::clock::WorkKind;
use super::constants::{LEDGER_CAPACITY, MAX_PASSED_OVER, MAX_UNSPENT_SHARE, MIN_SLICE_UNITS, SLICE};
use super::cost::{slice_of, smallest_slice, whole};
use super::ledger::nanos;
use super::queue::QueueEntry;
use super::state::{BuildStep, FrameTime, LongBuild};
use super::{ScheduledTree, Scheduler};
use crate::keys::TreeKey;
use crate::tree::{MAX_EXTRA_UNITS, WIDTH, units_of_build};

impl Scheduler {
    /// Starts the jobs of a frame, at time `now` of the clock.
    pub fn start_jobs(&mut self, budget: Duration, now: Duration) {
        let smallest_rebuild = self.costs.predict(whole(WIDTH));
        self.time = FrameTime { budget, start: now, min_spent: Duration::ZERO, smallest_rebuild };
    }

    /// Whether there is anything to do or to pay for.
    pub fn has_jobs(&self) -> bool {
        !self.queue.is_empty() || self.long_build.is_some()
    }

    /// Chooses the next [job](Scheduler::job). Returns whether there is one; there is none at the end
    /// of the frame.
    ///
    /// 1. The tree or the long build with the greatest priority comes first.
    /// 2. A tree that fits into the rest of the frame is rebuilt. Several small trees are one job.
    /// 3. A tree that exceeds even the whole budget of the frame gets a *long build*, if there is none:
    ///    from now on it is built in slices. Any other tree that does not fit is passed over. The
    ///    search ends after [`MAX_PASSED_OVER`] such trees, or once no rebuild fits any more.
    /// 4. The time that is left at the end goes to the long build. If there is none, a long build of
    ///    the first tree that was passed over begins, if the upper bound of its time exceeds 1 /
    ///    [`MAX_UNSPENT_SHARE`] of the budget and there is time for a slice.
    pub fn next_job(&mut self, now: Duration) -> bool {
        self.job.clear();
        if self.time.budget.is_zero() {
            return false;
        }
        while self.queue.passed_over() < MAX_PASSED_OVER {
            let left = self.left(now);
            self.take_whole_builds(left);
            if !self.job.is_empty() {
                return true;
            }
            // The first tree does not fit, or the long build comes first.
            let Some(tree) = self.first() else {
                let is_due = self.long_build.as_ref().is_some_and(LongBuild::is_due);
                if !is_due || !self.pay() {
                    break;
                }
                // The trees that were passed over because of the long build may get theirs now.
                self.queue.restore();
                continue;
            };
            if self.upper_bound(tree) > self.time.budget && self.long_build.is_none() {
                self.begin_long_build(tree);
            } else if left < self.time.smallest_rebuild {
                break;
            } else {
                self.queue.pass_over(tree);
            }
        }
        let min_cost = self.time.budget / MAX_UNSPENT_SHARE;
        let passed_over = self.queue.restore().filter(|tree| self.upper_bound(*tree) > min_cost);
        if self.long_build.is_none() && self.left(now) >= self.costs.upper_bound(smallest_slice(WIDTH)) {
            let Some(tree) = passed_over else { return false };
            self.begin_long_build(tree);
        }
        self.pay();
        self.job.extend(self.slice(now));
        !self.job.is_empty()
    }

    /// Takes the trees that come first and fit into the time that is left. The first of them may be of
    /// any size, and all together take no more than a slice.
    fn take_whole_builds(&mut self, left: Duration) {
        let left = nanos(left) / self.costs.margin(WorkKind::Rebuild);
        let max_nanos = left.min(nanos(SLICE));
        let mut sum = 0.0;
        while let Some(tree) = self.first() {
            let QueueEntry { since_frame, lights, .. } = self.queue.entry(tree);
            // As it is predicted now: the times of earlier batches may have changed that.
            let units = units_of_build(lights);
            let nanos = self.costs.nanos(whole(lights), units);
            let max_nanos = if self.job.is_empty() { left } else { max_nanos };
            if sum + nanos > max_nanos {
                break;
            }
            sum += nanos;
            self.job.push(BuildStep { tree, waited: self.frame - since_frame, work: whole(lights), units, nanos });
            self.queue.hide(tree);
        }
    }

    /// What to do next, or was done last: one step or, as reading the clock takes about 50 ns and the
    /// build of ten lights 2 µs, the builds of several small trees.
    pub fn job(&self) -> &[BuildStep] {
        &self.job
    }

    /// The first tree that waits, if it comes before the long build and its priority has reached 0.
    fn first(&self) -> Option<TreeKey> {
        let tree = self.queue.best()?;
        let rank = self.queue.entry(tree).rank;
        let build = self.long_build.as_ref().filter(|build| build.is_due());
        (self.priority(rank) >= 0.0 && build.is_none_or(|build| rank > build.rank)).then_some(tree)
    }

    /// The time that the rebuild of a tree that waits hardly ever exceeds.
    fn upper_bound(&self, tree: TreeKey) -> Duration {
        self.costs.upper_bound(whole(self.queue.entry(tree).lights))
    }

    /// The time that a job may take now.
    fn left(&self, now: Duration) -> Duration {
        self.time.left(now).min(self.ledger.balance())
    }

    /// Takes a tree out of the queue and begins a long build of it.
    fn begin_long_build(&mut self, tree: TreeKey) {
        let QueueEntry { since_frame, nanos, rank, .. } = self.queue.entry(tree);
        self.withdraw(tree);
        // The tree waits until the build is done and paid for.
        self.waiting_nanos += nanos;
        let ScheduledTree { lights, units, .. } = self.trees[tree];
        let units_left = units as usize;
        self.long_build = Some(LongBuild {
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

    /// The next slice of the long build, if there is time for it.
    fn slice(&self, now: Duration) -> Option<BuildStep> {
        let build = self.long_build.as_ref().filter(|build| build.unpaid.is_none())?;
        // A slice may take more units than it is given. On a slow machine even the smallest one is
        // longer than `SLICE`.
        let most = self.costs.slice_upper_bound(MIN_SLICE_UNITS + MAX_EXTRA_UNITS + 1, build.lights).max(SLICE);
        let units = self.costs.units_within(self.left(now).min(most), build.lights).saturating_sub(MAX_EXTRA_UNITS);
        // In frames that are too short for any slice, one is done whenever the ledger has saved up
        // enough for it, or as much as it can hold.
        let is_first = self.time.min_spent.is_zero();
        let saved = self.costs.upper_bound(smallest_slice(build.lights)).min(LEDGER_CAPACITY);
        let is_saved = is_first && self.ledger.balance() >= saved;
        let is_enough = units >= MIN_SLICE_UNITS.min(build.units_left) || is_saved;
        let units = units.max(MIN_SLICE_UNITS);
        let (tree, waited, work) = (build.tree?, self.frame - build.since_frame, slice_of(build.lights, units));
        is_enough.then_some(BuildStep { tree, waited, work, units: units as f64, nanos: 0.0 })
    }

    /// Pays for the long build in the background, as far as the ledger can. Returns whether nothing
    /// is left to pay for.
    fn pay(&mut self) -> bool {
        let Some(LongBuild { unpaid: Some(unpaid), .. }) = &mut self.long_build else { return false };
        *unpaid -= self.ledger.pay(*unpaid);
        let is_paid = *unpaid <= 0.0;
        self.end_if_done();
        is_paid
    }

    /// Ends the long build if it is done and paid for.
    pub(super) fn end_if_done(&mut self) {
        let is_done = |build: &mut LongBuild| {
            // A build in the background cannot be stopped.
            let has_ended = build.is_built || (build.tree.is_none() && build.unpaid.is_none());
            has_ended && !build.unpaid.is_some_and(|unpaid| unpaid > 0.0)
        };
        if let Some(build) = self.long_build.take_if(is_done) {
            self.waiting_nanos -= build.nanos;
        }
    }

    /// Forgets that a tree needs the long build. What the background does for it must still be paid
    /// for.
    pub fn cancel(&mut self, tree: TreeKey) {
        if let Some(build) = self.long_build.as_mut().filter(|build| build.tree == Some(tree)) {
            build.tree = None;
            self.end_if_done();
        }
    }

    /// How many frames the tree of the long build has waited.
    pub fn long_build_wait(&self) -> u64 {
        self.long_build.as_ref().map_or(0, |build| self.frame - build.since_frame)
    }
}

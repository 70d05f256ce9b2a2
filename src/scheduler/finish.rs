//! What jobs took.

use std::time::Duration;

use super::clock::{Work, WorkKind};
use super::constants::MAX_CHARGE_RATIO;
use super::cost::{self, CostModel, size_class, slice_of, smallest_slice, tree_lights, whole};
use super::ledger::nanos;
use super::state::{BuildStep, LongBuild};
use super::{ScheduledTree, Scheduler};
use crate::keys::TreeKey;
use crate::tree::WIDTH;

/// A job that was done.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DoneJob {
    pub work: Work,
    pub predicted: Duration,
    pub took: Duration,
    /// Frames since the tree began to wait.
    pub waited: u64,
}

impl Scheduler {
    /// The work of a rebuild of a whole tree.
    pub fn work_of_rebuild(&self, tree: TreeKey) -> Work {
        whole(self.trees[tree].lights)
    }

    /// Records what the slice that is the job has done: its units, and those that are left of the
    /// build. Returns its work.
    pub fn did_slice(&mut self, units: usize, units_left: usize) -> Work {
        let mut work = smallest_slice(WIDTH);
        if let Some(build) = &mut self.long_build {
            build.units_left = units_left;
            build.is_built = units_left == 0;
            work = slice_of(build.lights, units);
        }
        self.end_if_done();
        let units = cost::units(work);
        let nanos = self.costs.nanos(work, units);
        self.job.iter_mut().for_each(|step| *step = BuildStep { work, units, nanos, ..*step });
        work
    }

    /// Records the time of the job, which was done. It is divided among the steps in proportion to
    /// their predicted times, and counts as one measurement for each of their classes of size. Calls
    /// `report` for each step.
    pub fn finish_job(&mut self, took: Duration, mut report: impl FnMut(TreeKey, DoneJob)) {
        let Self { job, costs, .. } = self;
        let predicted: f64 = job.iter().map(|step| step.nanos).sum();
        let ratio = nanos(took) / predicted;
        let (mut left, mut units_of_all, mut learned) = (took, 0.0, 0_u64);
        for (index, BuildStep { tree, waited, work, units, nanos }) in job.iter().enumerate() {
            let class = 1 << size_class(tree_lights(*work));
            if learned & class == 0 {
                learned |= class;
                costs.learn_ratio(*work, nanos / units, ratio);
            }
            units_of_all += units;
            let is_last = index + 1 == job.len();
            let took = if is_last { left } else { Duration::from_nanos((nanos * ratio) as u64).min(left) };
            left -= took;
            let predicted = Duration::from_nanos(*nanos as u64);
            report(*tree, DoneJob { work: *work, predicted, took, waited: *waited });
        }
        self.ledger.charge(took, Duration::from_nanos(predicted as u64));
        self.time.min_spent = self.time.min_spent.saturating_add(CostModel::lower_bound(units_of_all));
    }

    /// Records the time of a rebuild outside of any budget.
    pub fn finish_rebuild_outside(&mut self, tree: TreeKey, took: Duration) {
        let ScheduledTree { lights, units, .. } = self.trees[tree];
        self.costs.learn(whole(lights), units, took);
    }

    /// Records that the long build goes on in the background, and returns its work. The ledger pays
    /// for the predicted time as it can.
    pub fn go_on_in_background(&mut self) -> Work {
        let lights = self.long_build.as_ref().map_or(0, |build| build.lights);
        let work = Work { kind: WorkKind::Background, lights };
        let predicted = nanos(self.costs.predict(work));
        if let Some(build) = &mut self.long_build {
            build.unpaid = Some(predicted);
        }
        work
    }

    /// Records that the build in the background has ended, and corrects its price.
    pub fn finish_background(&mut self, work: Work, took: Duration) {
        let predicted = nanos(self.costs.learn(work, cost::units(work), took));
        let Some(LongBuild { unpaid: Some(unpaid), is_built, .. }) = &mut self.long_build else { return };
        // As for other jobs, a machine that was suspended during the build does not pay for hours.
        let due = *unpaid + nanos(took).min(MAX_CHARGE_RATIO * predicted) - predicted;
        *unpaid = due.max(0.0);
        self.ledger.give_back((-due).max(0.0));
        *is_built = true;
        self.end_if_done();
    }
}

//! Spends the budget of a frame on rebuilds: chooses the next tree, and rebuilds it whole or in
//! part.

use std::time::Duration;

use super::LightWorld;
use super::schedule::{JobReport, QueuePosition, Schedule};
use super::update::FrameReport;
use crate::keys::{TreeKey, slot_of};
use crate::policy::{AttributeHistory, RebuildRequest};
use crate::scheduler::{CostModel, Replacement, TreeFeatures, Work, WorkKind};
use crate::tree::{RebuildPart, WIDTH};

/// The budget divided by this is reserved for the trees that have waited longest.
const OLDEST_SHARE: u32 = 16;

/// The budget divided by this is reserved for the background while a build waits to begin or the
/// background credit is negative. Otherwise many small trees would keep a large one waiting for
/// ever.
const BACKGROUND_SHARE: u32 = 4;

/// The time of rebuilds divided by this is spent on measurements of the noise that they remove.
const MEASUREMENT_SHARE: u32 = 20;

/// Smaller trees are never rebuilt in part: to search for their worst subtree takes longer than a
/// partial rebuild saves.
const MIN_PARTIAL_LIGHTS: usize = 256;

/// The search for jobs ends after this many trees that need more time than is left of the frame.
const MAX_DEFERRED: usize = 4;

/// The search for jobs ends after this many trees that could not be served.
const MAX_SUSPENDED: usize = 32;

/// At most this many trees are moved in one frame to the queue of those too large for a frame, and
/// as many back.
const MAX_RECLASSIFIED: usize = 16;

/// The number of waiting trees whose requests are refreshed in one frame even if they did not
/// change: their weights may have.
const REFRESHED_REQUESTS: usize = 1;

/// The smallest job. The search ends once less time is left.
const SMALLEST_JOB: Work = Work { kind: WorkKind::Rebuild, lights: WIDTH };

/// The time that the jobs of one frame may take.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrameTime {
    pub budget: Duration,
    /// The time of the clock before the first job.
    pub start: Duration,
    /// The least time that the jobs so far can have taken on any machine, independent of the
    /// clock.
    pub min_spent: Duration,
}

impl FrameTime {
    /// The time that is left of the budget.
    pub fn left(&self, now: Duration) -> Duration {
        self.budget.saturating_sub(now.saturating_sub(self.start).max(self.min_spent))
    }
}

/// The result of an attempt to serve a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// A job was done for the tree, or it requests nothing any more.
    Done,
    /// The job needs more time than is left of this frame.
    Deferred,
    /// The job needs more time than a frame has.
    TooLarge,
}

impl LightWorld {
    /// Returns the jobs of the last [`LightWorld::update`], in the order in which they were done.
    pub fn jobs(&self) -> &[JobReport] {
        &self.schedule.jobs
    }

    /// Runs the jobs of a frame.
    pub(super) fn run_jobs(&mut self, report: &mut FrameReport) {
        let budget = report.budget;
        let schedule = &mut self.schedule;
        schedule.jobs.clear();
        schedule.costs.shrink_margins();
        // The credit is at most one budget, so that a world at rest does not save up for a long
        // frame.
        if !budget.is_zero() {
            schedule.oldest_credit = schedule.oldest_credit.saturating_add(budget / OLDEST_SHARE).min(budget);
        }
        if !schedule.queue.is_empty() || schedule.snapshot.is_some() {
            let start = self.clock.now();
            let Schedule { background_credit, oversized, snapshot, builder, .. } = &self.schedule;
            let is_reserved = !builder.is_unavailable()
                && (*background_credit < 0.0 || oversized.first().is_some() || snapshot.is_some());
            let reserved = if is_reserved { budget / BACKGROUND_SHARE } else { Duration::ZERO };
            let mut time = FrameTime { budget: budget - reserved, start, min_spent: Duration::ZERO };
            self.refresh_requests();
            self.reclassify_oversized(&time);
            self.serve_oldest(&mut time, report);
            let too_large = self.serve_best(&mut time, report);
            self.serve_background(too_large, &mut time, report);
            let elapsed = self.clock.now().saturating_sub(start);
            let is_idle = self.schedule.jobs.is_empty();
            report.deciding = elapsed.saturating_sub(report.spent);
            // A frame that only finds out that no job fits is not an overrun.
            report.overrun = if is_idle { Duration::ZERO } else { elapsed.saturating_sub(budget) };
        }
        // The time that the frame leaves unused is credited to builds in the background.
        let unused = budget.saturating_sub(report.spent).as_nanos() as f64;
        let credit = &mut self.schedule.background_credit;
        *credit = (*credit + unused).min(budget.as_nanos() as f64);
        let Self { schedule, trees, .. } = self;
        let copied = schedule.snapshot.as_ref().map(|snapshot| snapshot.key);
        let oldest = [schedule.by_age.first(), schedule.oversized.first(), copied];
        let waits = oldest.into_iter().flatten().filter_map(|key| trees.get(key));
        let waits = waits.map(|entry| schedule.frame - entry.rebuild_state.requested_at);
        report.longest_wait = waits.chain([report.longest_wait]).max().unwrap_or(0);
        report.waiting_trees = schedule.queue.len();
        report.background.running = usize::from(schedule.running.is_some() || schedule.snapshot.is_some());
    }

    /// Refreshes the requests of some trees that wait, in turn.
    fn refresh_requests(&mut self) {
        for _ in 0..REFRESHED_REQUESTS.min(self.schedule.queue.len()) {
            let schedule = &mut self.schedule;
            if schedule.queue.is_empty() {
                return;
            }
            schedule.refreshed = (schedule.refreshed + 1) % schedule.queue.len();
            let key = schedule.queue.key(schedule.refreshed);
            self.update_request(key);
        }
    }

    /// Moves the oldest trees between the two wait queues if they have become too large for a
    /// frame, or are no longer; a few each frame, since each frame may have another budget.
    fn reclassify_oversized(&mut self, time: &FrameTime) {
        // No job of this frame gets more time than is left now.
        let available = time.left(self.clock.now());
        for _ in 0..MAX_RECLASSIFIED {
            let Some(key) = self.schedule.by_age.first() else { break };
            if available.is_zero() || self.fits(key, available) {
                break;
            }
            self.set_oversized(key, true);
        }
        for _ in 0..MAX_RECLASSIFIED {
            let Some(key) = self.schedule.oversized.first() else { break };
            if !self.fits(key, available) {
                break;
            }
            self.set_oversized(key, false);
        }
    }

    /// Rebuilds the trees that have waited longest, from a credit of their own, so that no tree
    /// waits for ever.
    fn serve_oldest(&mut self, time: &mut FrameTime, report: &mut FrameReport) {
        // The credit is saved up for large trees. One frame spends no more than its own share on
        // the oldest trees before it serves urgent requests.
        while report.spent <= report.budget / OLDEST_SHARE {
            let Some(key) = self.schedule.by_age.first() else { return };
            let entry = &self.trees[key];
            if !entry.may_rebuild() {
                self.withdraw_request(key);
                continue;
            }
            let work = Work { kind: WorkKind::Rebuild, lights: entry.tree.lights().len() };
            let cost = self.schedule.costs.predict(work);
            if cost > self.schedule.oldest_credit || self.serve(key, true, time, report) != Outcome::Done {
                return;
            }
            self.schedule.oldest_credit -= cost;
        }
    }

    /// Serves trees by priority. Returns the first that was too large for a frame.
    fn serve_best(&mut self, time: &mut FrameTime, report: &mut FrameReport) -> Option<TreeKey> {
        let (mut too_large, mut deferred) = (None, 0);
        while deferred < MAX_DEFERRED && self.schedule.suspended.len() < MAX_SUSPENDED {
            let Some(index) = self.schedule.queue.best() else { break };
            let key = self.schedule.queue.key(index);
            match self.serve(key, false, time, report) {
                Outcome::Done => continue,
                Outcome::TooLarge => too_large = too_large.or(Some(key)),
                Outcome::Deferred => deferred += 1,
            }
            if time.left(self.clock.now()) < self.schedule.costs.predict(SMALLEST_JOB) {
                break;
            }
            let score = self.schedule.queue.suspend(index);
            self.schedule.suspended.push((key, score));
        }
        // Trees that were served have left the queue since, which may have changed these trees'
        // indices.
        while let Some((key, score)) = self.schedule.suspended.pop() {
            if let Some(QueuePosition { index, .. }) = self.trees[key].rebuild_state.waiting {
                self.schedule.queue.resume(index, score);
            }
        }
        too_large
    }

    /// Rebuilds a tree, or the part of it that gains most, if there is time; if `is_whole`, the
    /// whole tree.
    fn serve(&mut self, key: TreeKey, is_whole: bool, time: &mut FrameTime, report: &mut FrameReport) -> Outcome {
        let before = self.clock.now();
        let entry = &self.trees[key];
        // The policies of its instances may have changed since the request, or the instances are
        // gone.
        if !entry.may_rebuild() {
            self.withdraw_request(key);
            return Outcome::Done;
        }
        let lights = entry.tree.lights().len();
        let left = time.left(before);
        let costs = &self.schedule.costs;
        let whole = Work { kind: WorkKind::Rebuild, lights };
        // Without background builds, a tree that is too large for a frame can only be rebuilt in
        // parts.
        let needs_parts = self.schedule.builder.is_unavailable() && costs.upper_bound(whole) > time.budget;
        let is_optional = entry.rebuild_state.request == RebuildRequest::Optional;
        let may_be_partial = !is_whole && (is_optional || needs_parts) && lights >= MIN_PARTIAL_LIGHTS;
        let mut part = if may_be_partial { entry.tree.worst(lights) } else { None };
        if may_be_partial && needs_parts {
            let fits =
                |lights: &usize| costs.upper_bound(Work { kind: WorkKind::RebuildPart, lights: *lights }) <= left;
            let max_lights = std::iter::successors(Some(lights / 2), |lights| Some(lights / 2)).take(24).find(fits);
            part = entry.tree.worst(max_lights.unwrap_or(0));
        }
        let part = part.filter(|part| !part.is_whole());
        let work = part.map_or(whole, |part| Work { kind: WorkKind::RebuildPart, lights: part.lights });
        if costs.upper_bound(work) > left {
            return if costs.upper_bound(whole) > time.budget { Outcome::TooLarge } else { Outcome::Deferred };
        }
        let probe = Work { kind: WorkKind::Probe, lights };
        let is_measured = part.is_none()
            && costs.predict(probe) <= self.schedule.measurement_credit
            && costs.upper_bound(work).saturating_add(costs.upper_bound(probe)) <= left;
        let waited = self.schedule.frame - entry.rebuild_state.requested_at;
        let variance_before = if is_measured { self.variance_of(key) } else { None };
        let begin = if is_measured { self.clock.now() } else { before };
        let replacement = match part {
            Some(part) => {
                report.rebuilt_parts += usize::from(self.rebuild_part(key, part));
                None
            }
            None => {
                report.rebuilt_trees += 1;
                Some(self.rebuild_whole(key))
            }
        };
        self.clock.worked(work);
        let end = self.clock.now();
        self.record_job(key, work, end.saturating_sub(begin), waited, time, report);
        let variance_after = if is_measured { self.variance_of(key) } else { None };
        if let Some(replacement) = replacement {
            let frame = self.schedule.frame;
            self.trees[key].rebuild_state.learn(&replacement, variance_before.zip(variance_after), frame);
        }
        if is_measured {
            self.clock.worked(probe);
            let took = begin.saturating_sub(before).saturating_add(self.clock.now().saturating_sub(end));
            self.record_job(key, probe, took, waited, time, report);
            self.schedule.measurement_credit = self.schedule.measurement_credit.saturating_sub(took);
        } else {
            let earned = end.saturating_sub(begin) / MEASUREMENT_SHARE;
            let credit = self.schedule.measurement_credit.saturating_add(earned);
            self.schedule.measurement_credit = credit.min(time.budget);
        }
        self.top.take();
        Outcome::Done
    }

    /// Records a job in the report and in the cost model.
    pub(super) fn record_job(
        &mut self,
        tree: TreeKey,
        work: Work,
        took: Duration,
        waited: u64,
        time: &mut FrameTime,
        report: &mut FrameReport,
    ) {
        let schedule = &mut self.schedule;
        let predicted = schedule.costs.predict(work);
        schedule.costs.learn(work, took);
        schedule.jobs.push(JobReport { tree, work, predicted, took, waited });
        time.min_spent = time.min_spent.saturating_add(CostModel::lower_bound(work));
        report.spent = report.spent.saturating_add(took);
        report.predicted = report.predicted.saturating_add(predicted);
        report.longest_wait = report.longest_wait.max(waited);
    }

    /// Rebuilds a whole tree and withdraws its request.
    pub(super) fn rebuild_whole(&mut self, key: TreeKey) -> Replacement {
        let entry = &mut self.trees[key];
        let before = TreeFeatures::of(&entry.tree);
        entry.tree.rebuild();
        let replacement = Replacement { before, after: TreeFeatures::of(&entry.tree) };
        entry.history = AttributeHistory::start(entry.tree.attributes());
        self.cancel_build(key);
        self.withdraw_request(key);
        self.changes.tree(slot_of(key));
        self.wake(key);
        replacement
    }

    /// Measures the noise of the choice within a tree at points around it; all measurements of one
    /// update use the same points relative to the tree.
    fn variance_of(&mut self, key: TreeKey) -> Option<f32> {
        let schedule = &mut self.schedule;
        self.trees[key].tree.variance_around(schedule.frame as u32, &mut schedule.pmfs)
    }

    /// Rebuilds a part of a tree. Returns false if the rebuild was abandoned: the new shape needs
    /// more nodes than the part has, and the tree is unchanged. Nothing is learnt from a partial
    /// rebuild.
    fn rebuild_part(&mut self, key: TreeKey, part: RebuildPart) -> bool {
        let entry = &mut self.trees[key];
        let is_rebuilt = entry.tree.rebuild_part(part);
        entry.record_change(self.schedule.frame);
        if is_rebuilt {
            self.changes.tree(slot_of(key));
        }
        self.wake(key);
        // The wait of a request that is still needed starts again.
        self.withdraw_request(key);
        self.update_request(key);
        is_rebuilt
    }

    /// Whether a rebuild of the tree hardly ever takes longer than a time.
    fn fits(&self, key: TreeKey, time: Duration) -> bool {
        let lights = self.trees[key].tree.lights().len();
        self.schedule.costs.upper_bound(Work { kind: WorkKind::Rebuild, lights }) <= time
    }
}

//! Builds trees that are too large for a frame in the background: copies their lights, starts the
//! builds, and installs the results.

use std::time::Duration;

use super::LightWorld;
use super::jobs::FrameTime;
use super::update::FrameReport;
use crate::keys::TreeKey;
use crate::scheduler::{LightSnapshot, Work, WorkKind};

/// A build is charged at most this many times the time that it was predicted to take.
const MAX_CHARGE_RATIO: f64 = 4.0;

/// Every n-th build goes to the tree that has waited longest; the others go by priority.
const OLDEST_BUILD_INTERVAL: u64 = 4;

/// Fewer lights are not worth a copy of their own, unless they are the last of a tree. Even a
/// budget of a microsecond is enough for so few.
const MIN_COPIED_LIGHTS: usize = 16;

impl LightWorld {
    /// Chooses a tree for a build in the background, copies its lights over one or several frames,
    /// and then starts the build. `best` is the tree with the highest priority that is too large
    /// for a frame.
    pub(super) fn serve_background(&mut self, best: Option<TreeKey>, time: &mut FrameTime, report: &mut FrameReport) {
        if self.schedule.running.is_some() || self.schedule.builder.is_unavailable() {
            return;
        }
        if self.schedule.snapshot.is_none() {
            if self.schedule.background_credit < 0.0 || time.budget.is_zero() {
                return;
            }
            let schedule = &self.schedule;
            let oldest = schedule.oversized.first();
            let is_turn_of_oldest = schedule.builds.is_multiple_of(OLDEST_BUILD_INTERVAL);
            let chosen = if is_turn_of_oldest { oldest.or(best) } else { best.or(oldest) };
            let Some(key) = chosen else { return };
            if !self.trees[key].may_rebuild() {
                return self.withdraw_request(key);
            }
            self.schedule.builds += 1;
            let build_id = self.schedule.builds;
            let requested_at = self.trees[key].rebuild_state.requested_at;
            self.withdraw_request(key);
            let entry = &mut self.trees[key];
            entry.rebuild_state.build_id = Some(build_id);
            entry.rebuild_state.requested_at = requested_at;
            let lights = Vec::with_capacity(entry.tree.lights().len());
            self.schedule.snapshot = Some(LightSnapshot { key, build_id, lights });
        }
        self.copy_lights(time, report);
    }

    /// Copies as many lights as there is time for, and starts the build after the last one.
    fn copy_lights(&mut self, time: &mut FrameTime, report: &mut FrameReport) {
        let before = self.clock.now();
        // Copies may use the time that was reserved for the background, too.
        let left = FrameTime { budget: report.budget, ..*time }.left(before);
        let Some(mut snapshot) = self.schedule.snapshot.take() else { return };
        let tree = self.trees.get(snapshot.key);
        let Some(entry) = tree.filter(|entry| entry.rebuild_state.build_id == Some(snapshot.build_id)) else {
            report.background.dropped += 1;
            return;
        };
        let missing = &entry.tree.lights()[snapshot.lights.len()..];
        let all = Work { kind: WorkKind::Snapshot, lights: missing.len() };
        let cost = self.schedule.costs.upper_bound(all);
        let count = match cost <= left {
            true => missing.len(),
            false => (missing.len() as f64 * left.as_secs_f64() / cost.as_secs_f64()) as usize,
        };
        if count < MIN_COPIED_LIGHTS.min(missing.len()) {
            self.schedule.snapshot = Some(snapshot);
            return;
        }
        snapshot.lights.extend_from_slice(&missing[..count]);
        let is_complete = count == missing.len();
        let work = Work { kind: WorkKind::Snapshot, lights: count };
        let (key, waited) = (snapshot.key, self.schedule.frame - entry.rebuild_state.requested_at);
        self.clock.worked(work);
        let now = self.clock.now();
        self.record_job(key, work, now.saturating_sub(before), waited, time, report);
        if is_complete {
            self.start_build(snapshot, now, report);
        } else {
            self.schedule.snapshot = Some(snapshot);
        }
    }

    fn start_build(&mut self, snapshot: LightSnapshot, now: Duration, report: &mut FrameReport) {
        let key = snapshot.key;
        let schedule = &mut self.schedule;
        let work = Work { kind: WorkKind::Background, lights: snapshot.lights.len() };
        let charged_nanos = schedule.costs.predict(work).as_nanos() as f64;
        schedule.running = schedule.builder.start(snapshot, work, charged_nanos, now);
        match &schedule.running {
            Some(_) => {
                schedule.background_credit -= charged_nanos;
                report.background.started += 1;
            }
            // Threads are unavailable.
            None => {
                self.cancel_build(key);
                self.update_request(key);
            }
        }
    }

    /// Passes a finished build to its tree, if the clock allows it. The refit that follows
    /// installs it.
    pub(super) fn take_finished_build(&mut self, report: &mut FrameReport) {
        let Some(running) = self.schedule.running.take() else { return };
        let Some(took) = self.clock.background(running.started, running.work, running.done()) else {
            self.schedule.running = Some(running);
            return;
        };
        let schedule = &mut self.schedule;
        schedule.costs.learn(running.work, took);
        // The prediction was charged at the start; the difference to the actual time is charged
        // now. The limit keeps a machine that was suspended during the build from paying for hours.
        let charged = running.charged_nanos;
        schedule.background_credit += charged - (took.as_nanos() as f64).min(MAX_CHARGE_RATIO * charged);
        report.background.spent = took;
        let (key, build_id) = (running.key, running.build_id);
        let built = running.wait();
        let entry = self.trees.get_mut(key).filter(|entry| entry.rebuild_state.build_id == Some(build_id));
        let (Some(entry), Some(built)) = (entry, built) else {
            report.background.dropped += 1;
            return;
        };
        entry.rebuild_state.build_id = None;
        if !entry.may_rebuild() {
            report.background.dropped += 1;
            return;
        }
        entry.rebuild_state.successor = Some(Box::new(built));
        report.background.taken += 1;
        report.longest_wait = report.longest_wait.max(self.schedule.frame - entry.rebuild_state.requested_at);
        self.pending.insert(key);
    }
}

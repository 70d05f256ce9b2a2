//! Spends a frame's budget on those that ask: who goes first, and what is done for them.

use std::time::Duration;

use super::LightWorld;
use super::schedule::{Schedule, Waiting};
use super::update::FrameReport;
use crate::keys::{TreeKey, slot_of};
use crate::policy::{AttributeHistory, RebuildRequest};
use crate::scheduler::{CostModel, Replaced, Signs, Snapshot, Work, WorkKind};
use crate::tree::{RebuildPart, WIDTH};

/// One in so many parts of the budget is for who has waited longest.
pub const PATIENCE: u32 = 16;

/// Builds in the background are paid from what frames leave over of their budgets. While one is to be paid for, or
/// waits to begin, frames leave over one in so many parts at least: else many small trees would keep a large one
/// waiting for ever.
const MIN_PURSE: u32 = 4;

/// A build is charged at most so many times what it was thought to take.
const MAX_PRICES: f64 = 4.0;

/// Every so manieth build in the background is for who has waited longest.
const BACKGROUND_PATIENCE: u64 = 4;

/// Smaller trees are rebuilt whole or not at all: to look for their worst subtree takes longer than it saves.
const MIN_DIVIDED: usize = 256;

/// Trees that do not fit into what is left of a frame before it ends.
const MAX_MISFITS: usize = 4;

/// Trees too large for any frame that are passed by in one.
const MAX_ASIDE: usize = 32;

/// Trees that are found in one frame to be too large for it, and as many not to be.
const MAX_MOVED: usize = 16;

/// Waiting trees that are judged anew each frame though their lights rest: what they matter may have changed.
const REJUDGED: usize = 1;

/// One in so many parts of the time of rebuilds is spent on looking at what they brought.
const CURIOSITY: u32 = 20;

/// Fewer lights are not worth a copy of their own. So few that the smallest budgets, a microsecond, are enough.
const MIN_COPIED: usize = 16;

/// A job of the last update.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobReport {
    /// For this tree.
    pub tree: TreeKey,
    /// What was done.
    pub work: Work,
    /// What it was thought to take.
    pub predicted: Duration,
    /// What it took by the world's clock.
    pub took: Duration,
    /// Updates since the tree asked for it.
    pub waited: u64,
}

/// No job is smaller.
const MIN_WORK: Work = Work { kind: WorkKind::Rebuild, lights: WIDTH };

/// The time of one frame.
#[derive(Clone, Copy)]
struct Frame {
    budget: Duration,
    start: Duration,
    /// What the jobs so far must have taken, whatever the clock says.
    least: Duration,
}

/// What became of a try to serve a tree.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Served {
    /// Something was done for it, or it asks no more.
    Done,
    /// There is not enough left of this frame.
    Later,
    /// No frame has room for it.
    TooLarge,
}

impl LightWorld {
    /// What was done in the last [`LightWorld::update`], in that order.
    pub fn jobs(&self) -> &[JobReport] {
        &self.schedule.jobs
    }

    /// Runs the jobs of a frame.
    pub(super) fn run_jobs(&mut self, report: &mut FrameReport) {
        let budget = report.budget;
        let schedule = &mut self.schedule;
        schedule.jobs.clear();
        schedule.costs.fade();
        // Nothing is saved up for longer than it takes to spend it: a world at rest gathers no right to a stall.
        if !budget.is_zero() {
            schedule.patience = schedule.patience.saturating_add(budget / PATIENCE).min(budget);
        }
        if !schedule.queue.is_empty() || schedule.snapshot.is_some() {
            let start = self.clock.now();
            let Schedule { purse, large, snapshot, builder, .. } = &self.schedule;
            let is_beside = !builder.is_off() && (*purse < 0.0 || large.first().is_some() || snapshot.is_some());
            let beside = if is_beside { budget / MIN_PURSE } else { Duration::ZERO };
            let mut frame = Frame { budget: budget - beside, start, least: Duration::ZERO };
            self.rejudge();
            self.sort_out_large(&frame);
            self.serve_oldest(&mut frame, report);
            let large = self.serve_best(&mut frame, report);
            self.serve_background(large, &mut frame, report);
            let all = self.clock.now().saturating_sub(start);
            let is_idle = self.schedule.jobs.is_empty();
            report.deciding = all.saturating_sub(report.spent);
            // Deciding that there is no time for anything breaks no promise.
            report.overrun = if is_idle { Duration::ZERO } else { all.saturating_sub(budget) };
        }
        // What the frame has left over is for the background.
        let over = budget.saturating_sub(report.spent).as_nanos() as f64;
        self.schedule.purse = (self.schedule.purse + over).min(budget.as_nanos() as f64);
        let Self { schedule, trees, .. } = self;
        let copied = schedule.snapshot.as_ref().map(|snapshot| snapshot.key);
        let oldest = [schedule.ages.first(), schedule.large.first(), copied];
        let waits = oldest.into_iter().flatten().filter_map(|key| trees.get(key));
        let waits = waits.map(|entry| schedule.frame - entry.standing.since);
        report.longest_wait = waits.chain([report.longest_wait]).max().unwrap_or(0);
        report.waiting_trees = schedule.queue.len();
        report.background.running = usize::from(schedule.running.is_some() || schedule.snapshot.is_some());
    }

    /// Time that is left of a frame.
    fn left(&self, now: Duration, frame: &Frame) -> Duration {
        frame.budget.saturating_sub(now.saturating_sub(frame.start).max(frame.least))
    }

    /// Some of those that wait matter more or less than when they came.
    fn rejudge(&mut self) {
        for _ in 0..REJUDGED.min(self.schedule.queue.len()) {
            let schedule = &mut self.schedule;
            if schedule.queue.is_empty() {
                return;
            }
            schedule.turn = (schedule.turn + 1) % schedule.queue.len();
            let key = schedule.queue.key(schedule.turn);
            self.judge(key);
        }
    }

    /// Those that no frame has room for any more, or has room for again, get to where they belong; a few each frame,
    /// since budgets may be other ones in each.
    fn sort_out_large(&mut self, frame: &Frame) {
        // What is left now is all that any job of this frame gets.
        let most = self.left(self.clock.now(), frame);
        for _ in 0..MAX_MOVED {
            let Some(key) = self.schedule.ages.first() else { break };
            if most.is_zero() || self.fits(key, most) {
                break;
            }
            self.set_large(key, true);
        }
        for _ in 0..MAX_MOVED {
            let Some(key) = self.schedule.large.first() else { break };
            if !self.fits(key, most) {
                break;
            }
            self.set_large(key, false);
        }
    }

    /// Who has waited longest is served from a purse of its own, so that nothing starves.
    fn serve_oldest(&mut self, frame: &mut Frame, report: &mut FrameReport) {
        // What was saved up is for large ones, and not to be spent in one frame before all that insist.
        while report.spent <= report.budget / PATIENCE {
            let Some(key) = self.schedule.ages.first() else { return };
            let entry = &self.trees[key];
            if !entry.may_rebuild() {
                self.leave(key);
                continue;
            }
            let work = Work { kind: WorkKind::Rebuild, lights: entry.tree.lights().len() };
            let cost = self.schedule.costs.predict(work);
            if cost > self.schedule.patience || self.serve(key, true, frame, report) != Served::Done {
                return;
            }
            self.schedule.patience -= cost;
        }
    }

    /// The best value for the time first. Returns the best of those that no frame has room for.
    fn serve_best(&mut self, frame: &mut Frame, report: &mut FrameReport) -> Option<TreeKey> {
        let (mut large, mut misfits) = (None, 0);
        while misfits < MAX_MISFITS && self.schedule.aside.len() < MAX_ASIDE {
            let Some(place) = self.schedule.queue.best() else { break };
            let key = self.schedule.queue.key(place);
            match self.serve(key, false, frame, report) {
                Served::Done => continue,
                Served::TooLarge => large = large.or(Some(key)),
                Served::Later => misfits += 1,
            }
            if self.left(self.clock.now(), frame) < self.schedule.costs.predict(MIN_WORK) {
                break;
            }
            let bits = self.schedule.queue.set_aside(place);
            self.schedule.aside.push((key, bits));
        }
        // Others may have left since, and what stands aside moved to another place.
        while let Some((key, bits)) = self.schedule.aside.pop() {
            if let Some(Waiting { place, .. }) = self.trees[key].standing.waiting {
                self.schedule.queue.restore(place, bits);
            }
        }
        large
    }

    /// Does the most worthwhile job for a tree, if there is time; if `is_whole`, nothing less than a rebuild.
    fn serve(&mut self, key: TreeKey, is_whole: bool, frame: &mut Frame, report: &mut FrameReport) -> Served {
        let before = self.clock.now();
        let entry = &self.trees[key];
        // Meanwhile its instances may have changed their minds, or gone.
        if !entry.may_rebuild() {
            self.leave(key);
            return Served::Done;
        }
        let lights = entry.tree.lights().len();
        let left = self.left(before, frame);
        let costs = &self.schedule.costs;
        let whole = Work { kind: WorkKind::Rebuild, lights };
        // Nothing will ever build it whole.
        let is_hopeless = self.schedule.builder.is_off() && costs.at_most(whole) > frame.budget;
        let is_divisible =
            !is_whole && (entry.standing.request == RebuildRequest::Optional || is_hopeless) && lights >= MIN_DIVIDED;
        let mut part = if is_divisible { entry.tree.worst(lights) } else { None };
        if is_divisible && is_hopeless {
            let fits = |lights: &usize| costs.at_most(Work { kind: WorkKind::RebuildPart, lights: *lights }) <= left;
            let most = std::iter::successors(Some(lights / 2), |lights| Some(lights / 2)).take(24).find(fits);
            part = entry.tree.worst(most.unwrap_or(0));
        }
        let part = part.filter(|part| !part.is_whole());
        let work = part.map_or(whole, |part| Work { kind: WorkKind::RebuildPart, lights: part.lights });
        if costs.at_most(work) > left {
            return if costs.at_most(whole) > frame.budget { Served::TooLarge } else { Served::Later };
        }
        let probe = Work { kind: WorkKind::Probe, lights };
        let is_probed = part.is_none()
            && costs.predict(probe) <= self.schedule.curiosity
            && costs.at_most(work).saturating_add(costs.at_most(probe)) <= left;
        let waited = self.schedule.frame - entry.standing.since;
        let noisy = if is_probed { self.variance_of(key) } else { None };
        let begin = if is_probed { self.clock.now() } else { before };
        let replaced = match part {
            Some(part) => self.rebuild_part(key, part),
            None => Some(self.rebuild_whole(key)),
        };
        self.clock.worked(work);
        let end = self.clock.now();
        self.note_job(key, work, end.saturating_sub(begin), waited, frame, report);
        match part {
            Some(_) => report.rebuilt_parts += 1,
            None => report.rebuilt_trees += 1,
        }
        let quiet = if is_probed { self.variance_of(key) } else { None };
        if let Some(replaced) = replaced {
            let frame = self.schedule.frame;
            self.trees[key].standing.learn(&replaced, noisy.zip(quiet), frame);
        }
        if is_probed {
            self.clock.worked(probe);
            let looked = begin.saturating_sub(before).saturating_add(self.clock.now().saturating_sub(end));
            self.note_job(key, probe, looked, waited, frame, report);
            self.schedule.curiosity = self.schedule.curiosity.saturating_sub(looked);
        } else {
            let earned = self.schedule.curiosity.saturating_add(end.saturating_sub(begin) / CURIOSITY);
            self.schedule.curiosity = earned.min(frame.budget);
        }
        self.top.take();
        Served::Done
    }

    /// Enters a job in the books.
    fn note_job(
        &mut self,
        tree: TreeKey,
        work: Work,
        took: Duration,
        waited: u64,
        frame: &mut Frame,
        report: &mut FrameReport,
    ) {
        let schedule = &mut self.schedule;
        let predicted = schedule.costs.predict(work);
        schedule.costs.learn(work, took);
        schedule.jobs.push(JobReport { tree, work, predicted, took, waited });
        frame.least = frame.least.saturating_add(CostModel::at_least(work));
        report.spent = report.spent.saturating_add(took);
        report.predicted = report.predicted.saturating_add(predicted);
        report.longest_wait = report.longest_wait.max(waited);
    }

    /// Builds a tree anew.
    pub(super) fn rebuild_whole(&mut self, key: TreeKey) -> Replaced {
        let entry = &mut self.trees[key];
        let before = Signs::of(&entry.tree);
        entry.tree.rebuild();
        let replaced = Replaced { before, fresh: Signs::of(&entry.tree) };
        entry.history = AttributeHistory::start(entry.tree.attributes());
        self.forget_build(key);
        self.leave(key);
        self.changes.tree(slot_of(key));
        self.wake(key);
        replaced
    }

    /// How noisy the choice in a tree is, seen from around it; from the same points in all of an update.
    fn variance_of(&mut self, key: TreeKey) -> Option<f32> {
        let schedule = &mut self.schedule;
        self.trees[key].tree.variance_around(schedule.frame as u32, &mut schedule.chances)
    }

    /// Builds a part of a tree anew; says nothing of what that brought.
    fn rebuild_part(&mut self, key: TreeKey, part: RebuildPart) -> Option<Replaced> {
        let entry = &mut self.trees[key];
        let is_changed = entry.tree.rebuild_part(part);
        entry.has_changed(self.schedule.frame);
        if is_changed {
            self.changes.tree(slot_of(key));
        }
        self.wake(key);
        // If it still asks, it does so from now on.
        self.leave(key);
        self.judge(key);
        None
    }

    /// Whether a rebuild is known to be done within a time.
    fn fits(&self, key: TreeKey, time: Duration) -> bool {
        let lights = self.trees[key].tree.lights().len();
        self.schedule.costs.at_most(Work { kind: WorkKind::Rebuild, lights }) <= time
    }

    /// Copies lights for a build in the background, and starts it when all are there. `best` is of those that no frame
    /// has room for.
    fn serve_background(&mut self, best: Option<TreeKey>, frame: &mut Frame, report: &mut FrameReport) {
        if self.schedule.running.is_some() || self.schedule.builder.is_off() {
            return;
        }
        if self.schedule.snapshot.is_none() {
            if self.schedule.purse < 0.0 || frame.budget.is_zero() {
                return;
            }
            let schedule = &self.schedule;
            let oldest = schedule.large.first();
            let is_turn_of_oldest = schedule.builds.is_multiple_of(BACKGROUND_PATIENCE);
            let chosen = if is_turn_of_oldest { oldest.or(best) } else { best.or(oldest) };
            let Some(key) = chosen else { return };
            if !self.trees[key].may_rebuild() {
                return self.leave(key);
            }
            self.schedule.builds += 1;
            let ticket = self.schedule.builds;
            let since = self.trees[key].standing.since;
            self.leave(key);
            let entry = &mut self.trees[key];
            entry.standing.build = Some(ticket);
            entry.standing.since = since;
            let lights = Vec::with_capacity(entry.tree.lights().len());
            self.schedule.snapshot = Some(Snapshot { key, ticket, lights });
        }
        self.copy_lights(frame, report);
    }

    fn copy_lights(&mut self, frame: &mut Frame, report: &mut FrameReport) {
        let before = self.clock.now();
        // What was kept for the background, too.
        let left = self.left(before, &Frame { budget: report.budget, ..*frame });
        let Some(mut snapshot) = self.schedule.snapshot.take() else { return };
        let wanted = self.trees.get(snapshot.key).filter(|entry| entry.standing.build == Some(snapshot.ticket));
        let Some(entry) = wanted else {
            report.background.dropped += 1;
            return;
        };
        let missing = &entry.tree.lights()[snapshot.lights.len()..];
        let all = Work { kind: WorkKind::Snapshot, lights: missing.len() };
        let cost = self.schedule.costs.at_most(all);
        // As many as there is time for.
        let count = match cost <= left {
            true => missing.len(),
            false => (missing.len() as f64 * left.as_secs_f64() / cost.as_secs_f64()) as usize,
        };
        if count < MIN_COPIED.min(missing.len()) {
            self.schedule.snapshot = Some(snapshot);
            return;
        }
        snapshot.lights.extend_from_slice(&missing[..count]);
        let is_complete = count == missing.len();
        let work = Work { kind: WorkKind::Snapshot, lights: count };
        let (key, waited) = (snapshot.key, self.schedule.frame - entry.standing.since);
        self.clock.worked(work);
        let now = self.clock.now();
        self.note_job(key, work, now.saturating_sub(before), waited, frame, report);
        if is_complete {
            self.start_build(snapshot, now, report);
        } else {
            self.schedule.snapshot = Some(snapshot);
        }
    }

    fn start_build(&mut self, snapshot: Snapshot, now: Duration, report: &mut FrameReport) {
        let key = snapshot.key;
        let schedule = &mut self.schedule;
        let work = Work { kind: WorkKind::Background, lights: snapshot.lights.len() };
        let price = schedule.costs.predict(work).as_nanos() as f64;
        schedule.running = schedule.builder.start(snapshot, work, price, now);
        match &schedule.running {
            Some(_) => {
                schedule.purse -= price;
                report.background.started += 1;
            }
            // There are no threads here.
            None => {
                self.forget_build(key);
                self.judge(key);
            }
        }
    }

    /// Hands a finished build to its tree, which takes it at the refit that follows.
    pub(super) fn take_build(&mut self, report: &mut FrameReport) {
        let Some(running) = self.schedule.running.take() else { return };
        let Some(took) = self.clock.background(running.started, running.work, running.done()) else {
            self.schedule.running = Some(running);
            return;
        };
        let schedule = &mut self.schedule;
        schedule.costs.learn(running.work, took);
        // What was thought to be paid already. A machine that slept meanwhile does not pay for ever.
        schedule.purse += running.price - (took.as_nanos() as f64).min(MAX_PRICES * running.price);
        report.background.spent = took;
        let (key, ticket) = (running.key, running.ticket);
        let tree = running.wait();
        let wanted = self.trees.get_mut(key).filter(|entry| entry.standing.build == Some(ticket));
        let (Some(entry), Some(tree)) = (wanted, tree) else {
            report.background.dropped += 1;
            return;
        };
        entry.standing.build = None;
        if !entry.may_rebuild() {
            report.background.dropped += 1;
            return;
        }
        entry.standing.successor = Some(Box::new(tree));
        report.background.taken += 1;
        report.longest_wait = report.longest_wait.max(self.schedule.frame - entry.standing.since);
        if !entry.is_edited {
            entry.is_edited = true;
            self.edited.push(key);
        }
    }
}

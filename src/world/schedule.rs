//! Who asks for a rebuild, and how badly.

use std::time::Duration;

use super::attention::Attention;
use super::jobs::JobReport;
use super::{LightWorld, TreeEntry};
use crate::keys::TreeKey;
use crate::policy::RebuildRequest;
use crate::scheduler::{
    Ages, Builder, CostModel, Decay, Forecast, Queue, Replaced, Running, Signs, Snapshot, Work, WorkKind,
};
use crate::tree::{LightTree, WIDTH};

/// How a tree waits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Waiting {
    /// In the queue.
    pub place: usize,
    /// In the order in which those came that fit into a frame, or those that do not.
    pub ticket: u64,
    pub is_large: bool,
}

/// What the scheduler knows of a tree.
#[derive(Default)]
pub(super) struct Standing {
    pub waiting: Option<Waiting>,
    pub request: RebuildRequest,
    /// The update in which it first asked.
    pub since: u64,
    pub forecast: Forecast,
    /// Logarithm of how much the variance is thought to have risen, as of the last change.
    pub rise: f32,
    pub decay: Decay,
    pub attention: Attention,
    /// The number of its build in the background.
    pub build: Option<u64>,
    /// That build's result, which takes its place at the next refit.
    pub successor: Option<Box<LightTree>>,
}

impl Standing {
    /// Of a copy of the tree: what was learnt.
    pub fn copy(&self) -> Self {
        Self { forecast: self.forecast, rise: self.rise, decay: self.decay, ..Self::default() }
    }

    /// A new tree of such a shape stands there.
    pub fn start(&mut self, fresh: Signs, frame: u64) {
        self.forecast.start(fresh);
        self.decay.start(frame);
        self.rise = 0.0;
    }

    /// A tree took another's place; what that brought was looked at, or not.
    pub fn learn(&mut self, replaced: &Replaced, variances: Option<(f32, f32)>, frame: u64) {
        self.forecast.learn(replaced, variances);
        self.start(replaced.fresh, frame);
    }
}

/// The world's part of it.
#[derive(Default)]
pub(super) struct Schedule {
    pub queue: Queue,
    pub costs: CostModel,
    /// Updates so far.
    pub frame: u64,
    /// What may be spent on who has waited longest.
    pub patience: Duration,
    /// What may be spent on looking at what rebuilds bring.
    pub curiosity: Duration,
    /// Of all lights of a tree that is looked at.
    pub chances: Vec<f32>,
    /// What builds in the background may spend, in nanoseconds; less than nothing while one is paid for.
    pub purse: f64,
    pub builder: Builder,
    pub snapshot: Option<Snapshot>,
    pub running: Option<Running>,
    /// Builds started in the background.
    pub builds: u64,
    /// Those that wait, in the order in which they came, but for those too large for a frame.
    pub ages: Ages,
    /// Those, in the order in which they were found to be.
    pub large: Ages,
    /// Trees that cannot be served in this frame, with what the queue knew of them.
    pub aside: Vec<(TreeKey, u32)>,
    /// Whose turn it is to be judged anew.
    pub turn: usize,
    /// Of the last update.
    pub jobs: Vec<JobReport>,
}

impl TreeEntry {
    /// Notes that its lights have changed, or its shape in part.
    pub(super) fn has_changed(&mut self, frame: u64) {
        let now = self.tree.attributes();
        self.history.observe(&now);
        let Standing { forecast, decay, rise, .. } = &mut self.standing;
        *rise = forecast.rise(&Signs::of(&self.tree));
        decay.change(frame, forecast.gain(*rise));
    }

    /// What its policies ask for.
    fn rebuild_request(&self) -> RebuildRequest {
        let now = self.tree.attributes();
        // Of the deviation, which is the root of the variance.
        let worse = (0.5 * self.standing.rise).exp_m1();
        let wanted = self.policies.rebuild_request(&self.history, &now, worse);
        // One node holds so few lights in only one way.
        let is_pointless = wanted == RebuildRequest::Optional && self.tree.lights().len() <= WIDTH;
        if is_pointless { RebuildRequest::None } else { wanted }
    }
}

impl LightWorld {
    /// A tree was refitted or rebuilt, or matters more or less than before: does it ask for a rebuild, and how badly?
    pub(super) fn judge(&mut self, key: TreeKey) {
        let entry = &self.trees[key];
        let mut wanted = entry.rebuild_request();
        // The algorithms of SS ask once, whatever comes after.
        if entry.standing.request == RebuildRequest::Required && entry.may_rebuild() {
            wanted = wanted.max(RebuildRequest::Required);
        }
        if wanted == RebuildRequest::None || entry.standing.build.is_some() {
            return self.leave(key);
        }
        let lights = entry.tree.lights().len();
        let gain = self.attention_of(key) * self.trees[key].standing.decay.savings(self.schedule.frame);
        let cost = self.schedule.costs.predict(Work { kind: WorkKind::Rebuild, lights }).as_nanos().max(1);
        // Never 0, which is for those that are set aside.
        let score = (gain / cost as f32).clamp(f32::MIN_POSITIVE, f32::MAX);
        let is_urgent = wanted == RebuildRequest::Urgent;
        let Self { schedule: Schedule { queue, ages, frame, .. }, trees, .. } = self;
        let standing = &mut trees[key].standing;
        standing.request = wanted;
        match standing.waiting {
            Some(Waiting { place, .. }) => queue.set(place, score, is_urgent),
            None => {
                let place = queue.push(key, score, is_urgent);
                standing.waiting = Some(Waiting { place, ticket: ages.push(key), is_large: false });
                standing.since = *frame;
            }
        }
    }

    /// A tree asks for nothing any more.
    pub(super) fn leave(&mut self, key: TreeKey) {
        let standing = &mut self.trees[key].standing;
        standing.request = RebuildRequest::None;
        let Some(Waiting { place, ticket, is_large }) = standing.waiting.take() else { return };
        let Schedule { queue, ages, large, .. } = &mut self.schedule;
        if is_large { large } else { ages }.take(ticket);
        let Some(moved) = queue.remove(place) else { return };
        if let Some(waiting) = &mut self.trees[moved].standing.waiting {
            waiting.place = place;
        }
    }

    /// A tree that waits turns out to be too large for a frame, or not to be.
    pub(super) fn set_large(&mut self, key: TreeKey, becomes_large: bool) {
        let Self { schedule: Schedule { ages, large, .. }, trees, .. } = self;
        let Some(Waiting { ticket, is_large, .. }) = &mut trees[key].standing.waiting else { return };
        if *is_large != becomes_large {
            let (from, to) = if becomes_large { (ages, large) } else { (large, ages) };
            from.take(*ticket);
            *ticket = to.push(key);
            *is_large = becomes_large;
        }
    }

    /// What is built in the background for a tree is no longer wanted.
    pub(super) fn forget_build(&mut self, key: TreeKey) {
        let standing = &mut self.trees[key].standing;
        standing.build = None;
        standing.successor = None;
    }
}

//! The state of the scheduler: one part for each tree, and one for all trees together.

use std::time::Duration;

use super::attention::TreeWeight;
use crate::keys::TreeKey;
use crate::policy::RebuildRequest;
use crate::scheduler::{
    BackgroundBuilder, CostModel, Decay, Forecast, LightSnapshot, PriorityQueue, Replacement, RunningBuild,
    TreeFeatures, WaitQueue, Work,
};
use crate::tree::LightTree;

/// One job of the last [`LightWorld::update`](crate::LightWorld::update): a rebuild, a copy of
/// lights for a build in the background, or a measurement of noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct JobReport {
    /// The tree that the job was for.
    pub tree: TreeKey,
    /// What was done. A [`WorkKind::RebuildPart`](crate::scheduler::WorkKind::RebuildPart) is
    /// listed even if it was abandoned, because it took time;
    /// [`FrameReport::rebuilt_parts`](crate::FrameReport::rebuilt_parts) does not count it.
    pub work: Work,
    /// The time that the job was predicted to take.
    pub predicted: Duration,
    /// The time that it took, by the world's clock.
    pub took: Duration,
    /// The number of updates since the tree requested a rebuild.
    pub waited: u64,
}

/// The position of a tree that waits for a rebuild.
#[derive(Clone, Copy, Debug)]
pub(super) struct QueuePosition {
    /// Its index in the priority queue.
    pub index: usize,
    /// Its sequence number in the wait queue: in [`Schedule::oversized`] if `is_oversized`,
    /// otherwise in [`Schedule::by_age`].
    pub sequence: u64,
    pub is_oversized: bool,
}

/// The scheduler's state for one tree.
#[derive(Debug, Default)]
pub(super) struct RebuildState {
    pub waiting: Option<QueuePosition>,
    pub request: RebuildRequest,
    /// The update of the first request that was not served yet.
    pub requested_at: u64,
    pub forecast: Forecast,
    /// The predicted logarithm of the rise of the variance, as of the last change.
    pub rise: f32,
    pub decay: Decay,
    pub weight: TreeWeight,
    /// The number of the tree's build in the background.
    pub build_id: Option<u64>,
    /// The result of that build; it replaces the tree at the next refit.
    pub successor: Option<Box<LightTree>>,
}

impl RebuildState {
    /// The state of a copy of the tree: it keeps what was learnt.
    pub fn for_copy(&self) -> Self {
        Self { forecast: self.forecast, rise: self.rise, decay: self.decay, ..Self::default() }
    }

    /// Resets the state for a tree that was just built.
    pub fn start(&mut self, features: TreeFeatures, frame: u64) {
        self.forecast.set_baseline(features);
        self.decay.reset(frame);
        self.rise = 0.0;
    }

    /// Learns from a rebuild, and resets the state. `variances` are the variances before and after
    /// it, if they were measured.
    pub fn learn(&mut self, replacement: &Replacement, variances: Option<(f32, f32)>, frame: u64) {
        self.forecast.learn(replacement, variances);
        self.start(replacement.after, frame);
    }
}

/// The scheduler's state for all trees together. Credits are time that may be spent later.
#[derive(Debug, Default)]
pub(super) struct Schedule {
    /// All trees that wait, by priority.
    pub queue: PriorityQueue,
    pub costs: CostModel,
    /// The number of updates so far.
    pub frame: u64,
    /// The credit of the trees that have waited longest.
    pub oldest_credit: Duration,
    /// The credit of measurements of noise.
    pub measurement_credit: Duration,
    /// The pmf of each light of the tree that is measured; kept for its allocation.
    pub pmfs: Vec<f32>,
    /// The credit of builds in the background, in nanoseconds; negative while a build exceeds what
    /// frames have left unused.
    pub background_credit: f64,
    pub builder: BackgroundBuilder,
    pub snapshot: Option<LightSnapshot>,
    pub running: Option<RunningBuild>,
    /// The number of builds in the background so far.
    pub builds: u64,
    /// The trees that wait and fit into a frame, by the time at which they came.
    pub by_age: WaitQueue,
    /// The trees that wait and are too large for a frame, by the time at which that was found.
    pub oversized: WaitQueue,
    /// Trees that cannot be served in this frame, with their scores in the queue.
    pub suspended: Vec<(TreeKey, u32)>,
    /// The index in the queue of the tree whose request was refreshed last.
    pub refreshed: usize,
    /// The jobs of the last update.
    pub jobs: Vec<JobReport>,
}

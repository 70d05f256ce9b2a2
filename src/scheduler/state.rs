//! The time of a frame, the trees that are rebuilt next, and the long build.

use std::time::Duration;

use super::clock::Work;
use crate::keys::TreeKey;

/// The time that the jobs of one frame may take.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FrameTime {
    pub budget: Duration,
    /// The time of the clock before the first job.
    pub start: Duration,
    /// The least time that the jobs so far can have taken on any machine, whatever the clock says.
    pub min_spent: Duration,
    /// The predicted time of the smallest rebuild.
    pub smallest_rebuild: Duration,
}

impl FrameTime {
    /// The time that is left of the budget.
    pub fn left(&self, now: Duration) -> Duration {
        self.budget.saturating_sub(now.saturating_sub(self.start).max(self.min_spent))
    }
}

/// A step of the build of a tree: all of it, or a slice of the long build.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BuildStep {
    pub tree: TreeKey,
    /// Frames since the tree began to wait.
    pub waited: u64,
    pub work: Work,
    /// The units of the work; of a slice that was not done yet, the most that it may have.
    pub units: f64,
    /// The predicted time.
    pub nanos: f64,
}

/// A build that takes more than a frame: it goes on in slices, or in the background.
#[derive(Clone, Debug)]
pub(super) struct LongBuild {
    /// `None` if the tree no longer needs the build.
    pub tree: Option<TreeKey>,
    pub rank: i64,
    /// The frame in which the tree began to wait.
    pub since_frame: u64,
    /// The predicted nanoseconds of the build, which count among those of the trees that wait.
    pub nanos: u64,
    pub lights: usize,
    pub units_left: usize,
    /// `None` for a build in frames, whose slices are charged as they are done. In the background:
    /// the nanoseconds that the ledger has not paid for yet. It ends once it is built and paid
    /// for.
    pub unpaid: Option<f64>,
    pub is_built: bool,
}

impl LongBuild {
    /// Whether the build needs time of this frame or of the ledger.
    pub fn is_due(&self) -> bool {
        self.unpaid.is_none_or(|unpaid| unpaid > 0.0)
    }
}

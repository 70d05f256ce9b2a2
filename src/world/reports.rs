//! What updates report of their work.

use std::time::Duration;

use crate::keys::TreeKey;
use crate::scheduler::{DoneJob, Work};

/// What [`LightWorld::update`](crate::LightWorld::update) did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct FrameReport {
    /// Instances that were added, moved, shown, hidden or removed since the last update, each
    /// counted once.
    pub moved_instances: usize,
    /// Trees that were refitted because their lights changed.
    pub refit_trees: usize,
    /// Lights of these trees.
    pub refit_lights: usize,
    /// Nodes of these trees that were computed anew: those above a changed light, or all nodes of a
    /// tree where many lights changed.
    pub refit_nodes: usize,
    /// Trees that were rebuilt within the frame.
    pub rebuilt_trees: usize,
    /// Trees that request a rebuild and wait for a later frame, without the tree whose build is
    /// under way: in slices, or in the background.
    pub waiting_trees: usize,
    /// 1 while a build goes on in slices, or while its lights are copied for the background; otherwise 0.
    pub sliced_builds: usize,
    /// Instances of opened trees, which have several leaves in the top level: of loose trees, and of
    /// trees whose lights shine to several sides.
    pub opened_instances: usize,
    /// Instances of crowded trees that are whole, or divided by side, because the instances of opened trees would be
    /// of more than 1,048,576 openings together.
    pub held_back_instances: usize,
    /// The leaves of the top level: one for each instance of a whole tree, and the openings of each
    /// instance of an opened tree.
    pub parts: usize,
    /// The longest wait in updates, of the trees that were served in this update and of the trees
    /// that still wait.
    pub longest_wait: u64,
    /// Builds on another thread.
    pub background: BackgroundReport,
    /// The time that rebuilds were allowed to take.
    pub budget: Duration,
    /// The predicted time of the rebuilds that were done.
    pub predicted: Duration,
    /// The measured time of the rebuilds that were done, by the world's clock. [`LightWorld::jobs`](crate::LightWorld::jobs)
    /// lists each.
    pub spent: Duration,
    /// The time that the choice among the waiting trees took.
    pub deciding: Duration,
    /// The time by which rebuilds and the choice among them exceeded the budget; 0 if nothing was
    /// rebuilt.
    pub overrun: Duration,
    /// The time that refits took. Refits are not part of the budget.
    pub refit_time: Duration,
}

/// The builds in the background of [`LightWorld::update`](crate::LightWorld::update): trees that do not fit into a frame, one
/// at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct BackgroundReport {
    /// Builds that were started in this update.
    pub started: usize,
    /// Builds that replaced their tree in this update, after a refit to the present lights.
    pub taken: usize,
    /// Builds that were dropped because their tree was removed, got other lights or changed its
    /// policy meanwhile.
    pub dropped: usize,
    /// Builds in progress, 0 or 1.
    pub running: usize,
    /// The time that the finished builds took, on their thread.
    pub spent: Duration,
}

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

impl FrameReport {
    /// Adds a job to the list of jobs and to the report.
    pub(super) fn add_job(&mut self, jobs: &mut Vec<JobReport>, tree: TreeKey, done: DoneJob) {
        let DoneJob { work, predicted, took, waited } = done;
        jobs.push(JobReport { tree, work, predicted, took, waited });
        self.spent = self.spent.saturating_add(took);
        self.predicted = self.predicted.saturating_add(predicted);
        self.longest_wait = self.longest_wait.max(waited);
    }
}

//! What a world has for the rebuilds of its trees.

use std::sync::Arc;

use super::attention::ViewWeights;
use super::build_thread::{BuildThread, RunningBuild};
use super::reports::JobReport;
use super::scene::Scene;
use crate::keys::TreeKey;
use crate::policy::RebuildRequest;
use crate::scheduler::{Clock, Scheduler, SystemClock};
use crate::tree::TreeBuild;

/// Which trees are rebuilt next, and the builds that are under way.
pub(super) struct Rebuilds {
    pub scheduler: Scheduler,
    pub clock: Arc<dyn Clock>,
    pub weights: ViewWeights,
    pub long_builder: LongBuilder,
    /// The jobs of the last update.
    pub jobs: Vec<JobReport>,
}

impl Default for Rebuilds {
    fn default() -> Self {
        Self {
            scheduler: Scheduler::default(),
            clock: Arc::new(SystemClock::default()),
            weights: ViewWeights::default(),
            long_builder: LongBuilder::default(),
            jobs: Vec::new(),
        }
    }
}

impl Rebuilds {
    /// Re-evaluates whether a tree requests a rebuild, and with which priority: after a refit or a
    /// change of its weight.
    pub fn update_request(&mut self, key: TreeKey, scene: &mut Scene) {
        let entry = &scene.trees[key];
        if !entry.may_rebuild() {
            return self.scheduler.withdraw(key);
        }
        let request = entry.rebuild_request(&entry.tree.attributes(), self.scheduler.excess(key));
        let request = self.scheduler.standing_request(key, request);
        let share =
            if request > RebuildRequest::Doubtful { self.weights.of(key, self.scheduler.frame(), scene) } else { 0.0 };
        self.scheduler.set_request(key, request, share);
    }
}

/// Does the long build that the scheduler has begun.
#[derive(Debug, Default)]
pub(super) struct LongBuilder {
    pub state: LongBuildState,
    pub thread: BuildThread,
    /// Builds never go on in the background.
    pub is_kept_in_frames: bool,
}

/// How far the long build is, and the revision of the tree's log at which it was begun.
#[derive(Debug, Default)]
pub(super) enum LongBuildState {
    #[default]
    None,
    InFrames(TreeKey, Box<TreeBuild>, u64),
    /// No tree if the tree does not need the build any more.
    InBackground(Option<TreeKey>, RunningBuild, u64),
}

impl LongBuilder {
    /// Frees the data of a tree of so many nodes, outside of the frame if they are many and threads are
    /// allowed.
    pub fn free<T: Send + 'static>(&mut self, data: T, nodes: usize) {
        if self.is_kept_in_frames { drop(data) } else { self.thread.free(data, nodes) }
    }

    /// Whether a build goes on in slices.
    pub fn is_in_frames(&self) -> bool {
        matches!(self.state, LongBuildState::InFrames(..))
    }

    /// Whether a build runs in the background or waits to be installed.
    pub fn is_in_background(&self) -> bool {
        matches!(self.state, LongBuildState::InBackground(..))
    }
}

//! Frame budgets and clocks: the inputs of the scheduler, which decides which trees are rebuilt.
//!
//! A [`LightWorld`](crate::LightWorld) rebuilds trees within a [`FrameBudget`], and reads the time
//! from a [`Clock`]. The default is the machine's clock, [`SystemClock`]; other clocks make a run
//! repeatable:
//!
//! | clock | time | use |
//! |---|---|---|
//! | [`SystemClock`] | measured | engines |
//! | [`VirtualClock`] | computed from the work | tests and benchmarks |
//! | [`RecordingClock`] | that of another clock, written to a list | bug reports |
//! | [`ReplayClock`] | read from that list | debugging |
//!
//! What is rebuilt depends on measured times, so two runs on [`SystemClock`] differ. A recorded run
//! can be replayed on any machine:
//!
//! ```
//! use std::sync::Arc;
//!
//! use girandole::glam::Vec3;
//! use girandole::scheduler::{Clock, RecordingClock, ReplayClock, SystemClock};
//! use girandole::{FrameBudget, FrameReport, Light, LightTree, LightWorld, Placement, Policy, WorldError};
//!
//! // The edits are the same in both runs; only the clock differs.
//! fn run(clock: Arc<dyn Clock>) -> Result<Vec<FrameReport>, WorldError> {
//!     let mut world = LightWorld::with_clock(clock);
//!     let lamp = |x: u32| Light::point(Vec3::new(x as f32, 4.0, 0.0), Vec3::ONE);
//!     let tree = world.add_tree(LightTree::new((0..100).map(lamp).collect())?);
//!     world.add_instance(tree, Placement::IDENTITY, Policy::Budgeted)?;
//!     let mut reports = Vec::new();
//!     for frame in 0..10 {
//!         let changes: Vec<_> = (0..100).map(|i| (i, lamp(37 * (i + frame) % 100))).collect();
//!         world.set_lights(tree, &changes)?;
//!         reports.push(world.update(FrameBudget::default()));
//!     }
//!     Ok(reports)
//! }
//!
//! let recording = Arc::new(RecordingClock::new(SystemClock::default()));
//! let recorded = run(recording.clone())?;
//! let replay = Arc::new(ReplayClock::new(recording.take_events()));
//! assert_eq!(run(replay.clone())?, recorded);
//! assert!(!replay.has_diverged());
//! # Ok::<(), WorldError>(())
//! ```

mod budget;
mod clock;
mod constants;
mod cost;
mod decay;
mod finish;
mod forecast;
mod jobs;
mod ledger;
mod queue;
mod replay;
mod requests;
mod state;
#[cfg(test)]
mod tests;

pub use budget::FrameBudget;
#[cfg(test)]
pub(crate) use clock::sealed;
pub use clock::{Clock, SystemClock, VirtualClock, Work, WorkKind};
pub(crate) use finish::DoneJob;
pub(crate) use forecast::TreeFeatures;
pub use replay::{ClockEvent, RecordingClock, ReplayClock};

use std::time::Duration;

use slotmap::SecondaryMap;

use crate::keys::TreeKey;
use crate::tree::units_of_build;
use cost::CostModel;
use decay::Decay;
use ledger::Ledger;
use queue::Queue;
pub(crate) use state::BuildStep;
use state::{FrameTime, LongBuild};

/// Decides which tree is rebuilt next.
///
/// The scheduler knows no trees and no world. It is told what has changed
/// ([`Scheduler::has_changed`], [`Scheduler::set_request`]) and what jobs took
/// ([`Scheduler::finish_job`]), and is asked for the next job ([`Scheduler::next_job`]).
///
/// Each tree that waits has a *priority*, in doublings:
///
/// ```text
/// priority = start + AGING * rounds waited
/// ```
///
/// `start` follows from the request of the tree's policies and from the noise that a rebuild
/// removes per time (`requests.rs`). A *round* is the time granted in which all trees that wait
/// could be rebuilt once. The tree with the greatest priority is served next, if that is at least
/// 0. Starts lie within a fixed range, so the wait has a bound in rounds that holds for any
/// sequence of budgets (`docs/math.md`, "How long a tree waits").
///
/// A tree that does not fit into the frame is built in slices, or on another thread. There is one
/// such *long build* at a time; it keeps the priority of its tree (`jobs.rs`).
#[derive(Debug, Default)]
pub(crate) struct Scheduler {
    trees: SecondaryMap<TreeKey, ScheduledTree>,
    queue: Queue,
    /// What to do next, or was done last.
    job: Vec<BuildStep>,
    long_build: Option<LongBuild>,
    ledger: Ledger,
    costs: CostModel,
    /// The number of frames so far.
    frame: u64,
    /// Rounds so far.
    rounds: f64,
    /// The predicted nanoseconds of all trees that wait.
    waiting_nanos: u64,
    /// The logarithm to base 2 of the greatest value of late, if there was any.
    top_value: Option<f32>,
    time: FrameTime,
}

/// What the scheduler knows about one tree.
#[derive(Clone, Debug, Default)]
struct ScheduledTree {
    /// The number of lights.
    lights: usize,
    /// The units of a rebuild.
    units: f64,
    /// The features right after the last build.
    built: TreeFeatures,
    decay: Decay,
    /// The predicted logarithm of the rise of the variance, as of the last change.
    rise: f32,
    /// A request of [`RebuildRequest::Required`] was made and not served yet.
    is_required: bool,
    waiting: Option<Waiting>,
}

/// Since when a tree waits.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    /// The number of rounds at which the tree began to wait.
    since_round: f64,
    /// The number of rounds at which the tree was last doubtful, or began to wait.
    asked_round: f64,
}

impl Scheduler {
    /// The number of frames so far.
    pub fn frame(&self) -> u64 {
        self.frame
    }

    /// The number of trees that wait, without the tree of a long build.
    pub fn waiting_trees(&self) -> usize {
        self.queue.len()
    }

    /// The longest wait in frames of the trees that wait, that of a long build included.
    pub fn longest_wait(&self) -> u64 {
        let oldest = self.queue.oldest().map(|tree| self.queue.entry(tree).since_frame);
        let build = self.long_build.as_ref().filter(|build| !build.is_built).map(|build| build.since_frame);
        oldest.into_iter().chain(build).map(|since| self.frame - since).max().unwrap_or(0)
    }

    /// One of the trees that wait, another one with each call.
    pub fn tree_in_turn(&mut self) -> Option<TreeKey> {
        self.queue.next_in_turn()
    }

    /// Whether the long build is of this tree, so that requests for it wait until its end.
    pub fn is_long_build_of(&self, tree: TreeKey) -> bool {
        self.long_build.as_ref().is_some_and(|build| build.tree == Some(tree) && !build.is_built)
    }

    /// Whether the tree waits for a rebuild, in the queue or for its long build.
    pub fn waits(&self, tree: TreeKey) -> bool {
        self.queue.contains(tree) || self.is_long_build_of(tree)
    }

    /// The frames for which a tree has waited for a rebuild, in the queue or for its long build;
    /// `None` if it does not wait.
    pub fn wait_of(&self, tree: TreeKey) -> Option<u64> {
        let build = self.long_build.as_ref().filter(|build| build.tree == Some(tree) && !build.is_built);
        let queued = || self.queue.contains(tree).then(|| self.queue.entry(tree).since_frame);
        build.map(|build| build.since_frame).or_else(queued).map(|since| self.frame - since)
    }

    /// The frames since a tree was last built.
    pub fn age_of(&self, tree: TreeKey) -> u64 {
        self.frame - self.trees[tree].decay.rebuilt_at()
    }

    /// Adds a tree that was just built.
    pub fn add(&mut self, tree: TreeKey, features: TreeFeatures, lights: usize) {
        let mut state = ScheduledTree::default();
        state.set_lights(lights);
        state.start(features, self.frame);
        self.trees.insert(tree, state);
    }

    /// Lets a tree begin with what is known about another one, of which it is a copy.
    pub fn copy(&mut self, from: TreeKey, to: TreeKey) {
        let state = ScheduledTree { waiting: None, is_required: false, ..self.trees[from].clone() };
        self.trees.insert(to, state);
    }

    /// Forgets a tree.
    pub fn remove(&mut self, tree: TreeKey) {
        self.withdraw(tree);
        self.cancel(tree);
        self.trees.remove(tree);
    }

    /// Starts a frame: grants its budget, and lets trees that wait age.
    pub fn start_frame(&mut self, budget: Duration) {
        self.frame += 1;
        self.ledger.grant(budget);
        self.costs.shrink_margins();
        if self.waiting_nanos > 0 {
            let rounds = (ledger::nanos(budget) / self.waiting_nanos as f64).min(1.0);
            self.advance_rounds(rounds);
        }
    }
}

impl ScheduledTree {
    fn set_lights(&mut self, lights: usize) {
        self.lights = lights;
        self.units = units_of_build(lights);
    }

    /// Resets what has happened since the last build.
    fn start(&mut self, features: TreeFeatures, frame: u64) {
        self.built = features;
        self.decay.reset(frame);
        self.rise = 0.0;
    }
}

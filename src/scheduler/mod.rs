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
//! use girandole::{FrameBudget, FrameReport, Light, LightWorld, Placement, Policy, WorldError};
//!
//! // The edits are the same in both runs; only the clock differs.
//! fn run(clock: Arc<dyn Clock>) -> Result<Vec<FrameReport>, WorldError> {
//!     let mut world = LightWorld::with_clock(clock);
//!     let lamp = |x: u32| Light::point(Vec3::new(x as f32, 4.0, 0.0), Vec3::ONE);
//!     let tree = world.add_tree((0..100).map(lamp).collect())?;
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

// None of these files depends on a world; `world/schedule.rs` and `world/jobs.rs` combine them.
mod background;
mod budget;
mod clock;
mod cost;
mod decay;
mod forecast;
mod priority_queue;
mod replay;
mod wait_queue;

pub(crate) use background::{BackgroundBuilder, LightSnapshot, RunningBuild};
pub use budget::FrameBudget;
pub use clock::{Clock, SystemClock, VirtualClock, Work, WorkKind};
pub(crate) use cost::CostModel;
pub(crate) use decay::Decay;
pub(crate) use forecast::{Forecast, Replacement, TreeFeatures};
pub(crate) use priority_queue::PriorityQueue;
pub use replay::{ClockEvent, RecordingClock, ReplayClock};
pub(crate) use wait_queue::WaitQueue;

//! The parts of a scheduler of rebuilds: time, costs, gains, who waits, and builds in the background. `world/jobs.rs` puts
//! them together.

mod ages;
mod background;
mod budget;
mod clock;
mod cost;
mod decay;
mod forecast;
mod queue;
mod replay;

pub(crate) use ages::Ages;
pub(crate) use background::{Builder, Running, Snapshot};
pub use budget::FrameBudget;
pub use clock::{Clock, SystemClock, VirtualClock, Work, WorkKind};
pub(crate) use cost::CostModel;
pub(crate) use decay::Decay;
pub(crate) use forecast::{Forecast, Replaced, Signs};
pub(crate) use queue::Queue;
pub use replay::{ClockEvent, RecordingClock, ReplayClock};

//! Spends a frame's budget on the rebuilds that policies ask for: most worsening and most light per predicted
//! microsecond first.

mod clock;
mod replay;

use std::time::Duration;

pub use clock::{Clock, SystemClock, VirtualClock, Work, WorkKind};
pub use replay::{ClockEvent, RecordingClock, ReplayClock};

/// The time that one frame may spend on rebuilds. Refits are not optional and not counted. A tree whose rebuild is
/// predicted to take longer than the whole budget waits until a frame has a larger one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameBudget(Duration);

impl FrameBudget {
    /// Rebuild whatever is asked for.
    pub const UNLIMITED: Self = Self(Duration::MAX);
    /// Rebuild nothing.
    pub const NONE: Self = Self(Duration::ZERO);

    /// A few tenths of a millisecond are usual.
    pub const fn new(time: Duration) -> Self {
        Self(time)
    }

    /// The time.
    pub const fn time(&self) -> Duration {
        self.0
    }
}

/// A tree that asks for a rebuild.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Job<K> {
    pub key: K,
    /// Policy::AlwaysRebuild: goes before all others.
    pub first: bool,
    /// Worsening times flux.
    pub gain: f32,
    /// Lights to sort into the new tree.
    pub lights: usize,
    /// Frames it has waited; raises its rank, so that nothing starves.
    pub waited: u32,
}

/// Nanoseconds of a rebuild per light and level, learnt from those that ran.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CostModel {
    nanos_per_unit: f64,
}

/// Before the first measurement: 100 ns per light and level, about what one core of a 2020s desktop takes.
const FIRST_GUESS: f64 = 100.0;
/// Weight of a new measurement; the last twenty or so count.
const LEARNING_RATE: f64 = 0.1;
/// A measurement counts as at most this many times the present estimate, so that one stall does not stop all rebuilds.
const OUTLIER: f64 = 4.0;

impl Default for CostModel {
    fn default() -> Self {
        Self { nanos_per_unit: FIRST_GUESS }
    }
}

impl CostModel {
    fn units(lights: usize) -> f64 {
        let n = lights.max(1) as f64;
        n * (n.log2() + 1.0)
    }

    /// What rebuilding a tree of so many lights will take.
    pub fn predict(&self, lights: usize) -> Duration {
        Duration::from_nanos((self.nanos_per_unit * Self::units(lights)).min(1.0e18) as u64)
    }

    /// Learns from a rebuild that took `spent`.
    pub fn learn(&mut self, lights: usize, spent: Duration) {
        let seen = spent.as_nanos() as f64 / Self::units(lights);
        let seen = seen.clamp(self.nanos_per_unit / OUTLIER, self.nanos_per_unit * OUTLIER);
        self.nanos_per_unit += LEARNING_RATE * (seen - self.nanos_per_unit);
    }
}

/// Orders jobs by what they buy; a tie goes to the lower key.
pub(crate) fn rank<K: Ord + Copy>(jobs: &mut [Job<K>], model: &CostModel) {
    let value = |job: &Job<K>| {
        let cost = model.predict(job.lights).as_nanos().max(1) as f32;
        job.gain.max(f32::MIN_POSITIVE) / cost * (1.0 + job.waited as f32)
    };
    jobs.sort_by(|a, b| b.first.cmp(&a.first).then(value(b).total_cmp(&value(a))).then(a.key.cmp(&b.key)));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(key: u32, gain: f32, lights: usize) -> Job<u32> {
        Job { key, first: false, gain, lights, waited: 0 }
    }

    #[test]
    fn the_best_value_for_the_time_comes_first_and_always_before_it() {
        let model = CostModel::default();
        let mut jobs =
            [job(0, 1.0, 1000), job(1, 2.0, 1000), job(2, 1.0, 10), Job { first: true, ..job(3, 0.0, 9999) }];
        rank(&mut jobs, &model);
        assert_eq!(jobs.map(|j| j.key), [3, 2, 1, 0]);
        let mut waited = [job(0, 2.0, 100), Job { waited: 9, ..job(1, 1.0, 100) }];
        rank(&mut waited, &model);
        assert_eq!(waited[0].key, 1);
    }

    #[test]
    fn the_cost_model_learns_and_shrugs_off_a_stall() {
        let mut model = CostModel::default();
        let true_cost = Duration::from_micros(700);
        for _ in 0..200 {
            model.learn(1000, true_cost);
        }
        assert!((model.predict(1000).as_secs_f64() / true_cost.as_secs_f64() - 1.0).abs() < 0.01);
        model.learn(1000, Duration::from_secs(3));
        assert!(model.predict(1000) < true_cost * 2);
    }
}

//! What work will take, learnt from what it took.

use std::time::Duration;

use super::clock::{Work, WorkKind};

/// Nanoseconds of each kind of work by its lights, learnt from what was measured: for each doubling of the lights a
/// typical value, and for each kind how far above it the worst of late have been.
#[derive(Clone, Debug)]
pub(crate) struct CostModel {
    kinds: [Learnt; KINDS],
}

const KINDS: usize = 4;

/// Tree sizes are told apart by their number of binary digits.
const SIZES: usize = u32::BITS as usize;

/// Nanoseconds per unit before the first measurement: what one core of a 2020s server took (docs/benchmarks.md). A
/// rebuild counts lights times levels, a copy and a probe lights.
const FIRST_GUESS: [f32; KINDS] = [25.0, 25.0, 10.0, 150.0];

/// Until something is known, work may take e to the power of this as long as guessed: twice.
const FIRST_MARGIN: f32 = 0.7;

/// A measurement counts as at most this many times the present estimate and as at least this part of it, so that one
/// stall does not stop all rebuilds, nor a clock that jumps let them run wild.
const OUTLIER: f32 = 4.0;

/// Weight of a new measurement; the last ten or so of a size count.
const LEARNING_RATE: f32 = 0.1;

/// The first few measurements of a size weigh more, as in a plain mean.
const FIRST_RATE: f32 = 0.5;

/// How much of the margin is left after a frame: half of it after 700. What was slow once may not be so for ever.
const MARGIN_KEPT: f32 = 0.999;

/// The margin stays above this, 1.6 times the typical: of 400 builds of a size the slowest took 1.3 to 1.8 times as
/// long as the mean (2-core AMD EPYC virtual machine, 2026-11-21, `costs.csv` of the budget example).
const MIN_MARGIN: f32 = 0.5;

/// No unit takes less, about a tenth of what a 2020s server takes: on a clock that stands still, frames stay bounded.
const MIN_NANOS: [f64; KINDS] = [2.0, 2.0, 0.5, 10.0];

/// Nothing takes longer than this many nanoseconds, some thirty years: sums stay inside [`Duration`].
const MAX_NANOS: f64 = 1.0e18;

#[derive(Clone, Debug)]
struct Learnt {
    /// Logarithm of the nanoseconds per unit, and how many were measured.
    sizes: [(f32, u32); SIZES],
    /// Of the logarithm of actual over typical, what hardly any exceed.
    margin: f32,
}

impl Default for CostModel {
    fn default() -> Self {
        Self { kinds: FIRST_GUESS.map(|guess| Learnt { sizes: [(guess.ln(), 0); SIZES], margin: FIRST_MARGIN }) }
    }
}

fn index(kind: WorkKind) -> usize {
    match kind {
        WorkKind::Rebuild | WorkKind::Background | WorkKind::Refit => 0,
        WorkKind::RebuildPart => 1,
        WorkKind::Snapshot => 2,
        WorkKind::Probe => 3,
    }
}

fn units(work: Work) -> f64 {
    let n = work.lights.max(1) as f64;
    match work.kind {
        WorkKind::Snapshot | WorkKind::Probe => n,
        _ => n * (n.log2() + 1.0),
    }
}

fn size(lights: usize) -> usize {
    (usize::BITS - lights.max(1).leading_zeros()) as usize % SIZES
}

fn duration(nanos: f64) -> Duration {
    // NaN becomes 0.
    Duration::from_nanos(nanos.min(MAX_NANOS) as u64)
}

impl CostModel {
    /// What it will typically take.
    pub fn predict(&self, work: Work) -> Duration {
        duration(self.nanos(work))
    }

    /// What it will hardly ever exceed.
    pub fn at_most(&self, work: Work) -> Duration {
        duration(self.nanos(work) * f64::from(self.kinds[index(work.kind)].margin.exp()))
    }

    /// No machine is faster.
    pub fn at_least(work: Work) -> Duration {
        duration(units(work) * MIN_NANOS[index(work.kind)])
    }

    fn nanos(&self, work: Work) -> f64 {
        units(work) * f64::from(self.ln_nanos(work).exp())
    }

    /// Logarithm of the nanoseconds per unit. What was never measured takes as much as the nearest size that was.
    fn ln_nanos(&self, work: Work) -> f32 {
        let sizes = &self.kinds[index(work.kind)].sizes;
        let size = size(work.lights);
        if sizes[size].1 > 0 {
            return sizes[size].0;
        }
        let measured = |size: &usize| sizes.get(*size).is_some_and(|(_, count)| *count > 0);
        let nearest = (0..SIZES).flat_map(|step| [size.wrapping_sub(step), size + step]).find(measured);
        sizes[nearest.unwrap_or(size)].0
    }

    /// Learns from work that took `spent`.
    pub fn learn(&mut self, work: Work, spent: Duration) {
        let typical = self.ln_nanos(work);
        let limit = OUTLIER.ln();
        let least = MIN_NANOS[index(work.kind)];
        // How far off, as a logarithm.
        let off = (spent.as_nanos() as f64 / units(work)).max(least).ln() as f32 - typical;
        let off = off.clamp(-limit, limit);
        let learnt = &mut self.kinds[index(work.kind)];
        let (known, count) = &mut learnt.sizes[size(work.lights)];
        let rate = (1.0 / (*count as f32 + 1.0)).clamp(LEARNING_RATE, FIRST_RATE);
        *known = typical + rate * off;
        *count = count.saturating_add(1);
        learnt.margin = learnt.margin.max(off);
    }

    /// A frame has passed.
    pub fn fade(&mut self) {
        self.kinds.iter_mut().for_each(|kind| kind.margin = (kind.margin * MARGIN_KEPT).max(MIN_MARGIN));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rebuild(lights: usize) -> Work {
        Work { kind: WorkKind::Rebuild, lights }
    }

    #[test]
    fn it_learns_and_shrugs_off_a_stall() {
        let mut model = CostModel::default();
        let true_cost = Duration::from_micros(700);
        for _ in 0..200 {
            model.learn(rebuild(1000), true_cost);
        }
        let ratio = |model: &CostModel| model.predict(rebuild(1000)).as_secs_f64() / true_cost.as_secs_f64();
        assert!((ratio(&model) - 1.0).abs() < 0.01);
        model.learn(rebuild(1000), Duration::from_secs(3));
        assert!(ratio(&model) < 1.2);
        // What was never measured is reckoned from what was.
        let larger = model.predict(rebuild(10_000)).as_secs_f64() / true_cost.as_secs_f64();
        assert!((larger - 10.0 * (10_000_f64.log2() + 1.0) / (1000_f64.log2() + 1.0)).abs() < 2.0, "{larger}");
    }

    #[test]
    fn it_keeps_clear_of_the_worst_of_late_and_forgets_it() {
        let mut model = CostModel::default();
        for i in 0..500 {
            model.learn(rebuild(100), Duration::from_micros(if i % 50 == 0 { 40 } else { 20 }));
        }
        let [typical, most] = [model.predict(rebuild(100)), model.at_most(rebuild(100))];
        assert!(typical > Duration::from_micros(19) && typical < Duration::from_micros(22), "{typical:?}");
        assert!(most >= Duration::from_micros(39), "{most:?}");
        assert!(most > typical.mul_f32(MIN_MARGIN.exp()), "{most:?}");
        (0..5000).for_each(|_| model.fade());
        let least = typical.mul_f32(MIN_MARGIN.exp());
        assert!(model.at_most(rebuild(100)).abs_diff(least) < Duration::from_nanos(10));
    }

    #[test]
    fn costs_of_nothing_and_of_ever_leave_it_sane() {
        let mut model = CostModel::default();
        for spent in [Duration::ZERO, Duration::MAX, Duration::ZERO] {
            for kind in [WorkKind::Rebuild, WorkKind::RebuildPart, WorkKind::Snapshot, WorkKind::Probe] {
                for lights in [0, 1, 50, 1 << 30, usize::MAX] {
                    let work = Work { kind, lights };
                    for _ in 0..1000 {
                        model.learn(work, spent);
                    }
                    let [least, typical, most] = [CostModel::at_least(work), model.predict(work), model.at_most(work)];
                    assert!(typical <= most, "{work:?} {typical:?} {most:?}");
                    assert!(lights < 2 || !least.is_zero());
                    // The last digit of a logarithm.
                    assert!(typical.as_nanos() as f64 >= 0.999 * least.as_nanos() as f64, "{work:?} {typical:?}");
                }
            }
        }
    }
}

//! The time that work will take, learnt from measurements.

use std::time::Duration;

use super::clock::{Work, WorkKind};

/// The cost of each kind of work, by its number of lights, learnt from measurements: a typical cost
/// for each doubling of the lights, and for each kind a margin for the slowest jobs of late.
#[derive(Clone, Debug)]
pub(crate) struct CostModel {
    kinds: [KindCosts; KINDS],
}

/// Kinds of work with costs of their own.
const KINDS: usize = 4;

/// Tree sizes are classed by their number of binary digits.
const SIZES: usize = u32::BITS as usize;

/// Nanoseconds per unit of work before the first measurement: what one core of a 2020s server took
/// (docs/benchmarks.md). The unit of a rebuild is one light in one level, that of a copy or a
/// measurement of noise one light.
const INITIAL_NANOS: [f32; KINDS] = [25.0, 25.0, 10.0, 150.0];

/// The initial margin, as a logarithm: work may take twice as long as the initial costs say.
const INITIAL_LN_MARGIN: f32 = 0.7;

/// A measurement counts as at most this many times the present estimate, and as at least the
/// reciprocal of it. So one stall does not stop all rebuilds, and a clock that jumps back does not
/// start too many.
const MAX_DEVIATION: f32 = 4.0;

/// The least weight of a new measurement: about the last ten of a size count.
const MIN_LEARNING_RATE: f32 = 0.1;

/// The greatest weight of a new measurement. The first few of a size weigh more, as in a plain
/// mean.
const MAX_LEARNING_RATE: f32 = 0.5;

/// The part of the margin that is left after a frame; half of it is left after 700 frames. So a
/// single slow job does not count for ever.
const MARGIN_RETENTION: f32 = 0.999;

/// The least margin, as a logarithm: 1.6 times the typical cost. Of 400 builds of a size the
/// slowest took 1.3 to 1.8 times as long as the mean (2-core AMD EPYC virtual machine, 2026-11-21,
/// `costs.csv` of the budget example).
const MIN_LN_MARGIN: f32 = 0.5;

/// The least nanoseconds per unit of work, about a tenth of what a 2020s server takes. They keep
/// frames bounded on a clock that has stopped.
const MIN_NANOS: [f64; KINDS] = [2.0, 2.0, 0.5, 10.0];

/// The greatest nanoseconds of a job, some thirty years, so that sums stay within [`Duration`].
const MAX_NANOS: f64 = 1.0e18;

/// The costs of one kind of work.
#[derive(Clone, Debug)]
struct KindCosts {
    sizes: [SizeCost; SIZES],
    /// The logarithm of the ratio of actual to typical cost that hardly any job exceeds.
    ln_margin: f32,
}

/// The typical cost of one kind of work in one class of sizes.
#[derive(Clone, Copy, Debug)]
struct SizeCost {
    /// The logarithm of the nanoseconds per unit.
    ln_nanos: f32,
    /// The number of measurements.
    count: u32,
}

impl Default for CostModel {
    fn default() -> Self {
        let kind = |nanos: f32| KindCosts {
            sizes: [SizeCost { ln_nanos: nanos.ln(), count: 0 }; SIZES],
            ln_margin: INITIAL_LN_MARGIN,
        };
        Self { kinds: INITIAL_NANOS.map(kind) }
    }
}

fn kind_index(kind: WorkKind) -> usize {
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

fn size_class(lights: usize) -> usize {
    (usize::BITS - lights.max(1).leading_zeros()) as usize % SIZES
}

fn duration(nanos: f64) -> Duration {
    // The cast turns NaN into 0.
    Duration::from_nanos(nanos.min(MAX_NANOS) as u64)
}

impl CostModel {
    /// The time that the work typically takes.
    pub fn predict(&self, work: Work) -> Duration {
        duration(self.nanos(work))
    }

    /// The time that the work hardly ever exceeds.
    pub fn upper_bound(&self, work: Work) -> Duration {
        duration(self.nanos(work) * f64::from(self.kinds[kind_index(work.kind)].ln_margin.exp()))
    }

    /// The time that the work takes on the fastest machine.
    pub fn lower_bound(work: Work) -> Duration {
        duration(units(work) * MIN_NANOS[kind_index(work.kind)])
    }

    fn nanos(&self, work: Work) -> f64 {
        units(work) * f64::from(self.ln_nanos(work).exp())
    }

    /// The logarithm of the nanoseconds per unit. A size that was never measured counts as the
    /// nearest size that was.
    fn ln_nanos(&self, work: Work) -> f32 {
        let sizes = &self.kinds[kind_index(work.kind)].sizes;
        let class = size_class(work.lights);
        if sizes[class].count > 0 {
            return sizes[class].ln_nanos;
        }
        let is_measured = |class: &usize| sizes.get(*class).is_some_and(|size| size.count > 0);
        let nearest = (0..SIZES).flat_map(|step| [class.wrapping_sub(step), class + step]).find(is_measured);
        sizes[nearest.unwrap_or(class)].ln_nanos
    }

    /// Learns from work that took `spent`.
    pub fn learn(&mut self, work: Work, spent: Duration) {
        let typical = self.ln_nanos(work);
        let limit = MAX_DEVIATION.ln();
        let min_nanos = MIN_NANOS[kind_index(work.kind)];
        let deviation = (spent.as_nanos() as f64 / units(work)).max(min_nanos).ln() as f32 - typical;
        let deviation = deviation.clamp(-limit, limit);
        let costs = &mut self.kinds[kind_index(work.kind)];
        let size = &mut costs.sizes[size_class(work.lights)];
        let rate = (1.0 / (size.count as f32 + 1.0)).clamp(MIN_LEARNING_RATE, MAX_LEARNING_RATE);
        size.ln_nanos = typical + rate * deviation;
        size.count = size.count.saturating_add(1);
        costs.ln_margin = costs.ln_margin.max(deviation);
    }

    /// Shrinks the margins; to be called once per frame.
    pub fn shrink_margins(&mut self) {
        for costs in &mut self.kinds {
            costs.ln_margin = (costs.ln_margin * MARGIN_RETENTION).max(MIN_LN_MARGIN);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rebuild(lights: usize) -> Work {
        Work { kind: WorkKind::Rebuild, lights }
    }

    #[test]
    fn the_model_learns_a_cost_and_one_stall_hardly_changes_it() {
        let mut model = CostModel::default();
        let true_cost = Duration::from_micros(700);
        for _ in 0..200 {
            model.learn(rebuild(1000), true_cost);
        }
        let ratio = |model: &CostModel| model.predict(rebuild(1000)).as_secs_f64() / true_cost.as_secs_f64();
        assert!((ratio(&model) - 1.0).abs() < 0.01);
        model.learn(rebuild(1000), Duration::from_secs(3));
        assert!(ratio(&model) < 1.2);
        // A size that was never measured has the cost per unit of the nearest measured size.
        let larger = model.predict(rebuild(10_000)).as_secs_f64() / true_cost.as_secs_f64();
        assert!((larger - 10.0 * (10_000_f64.log2() + 1.0) / (1000_f64.log2() + 1.0)).abs() < 2.0, "{larger}");
    }

    #[test]
    fn the_upper_bound_covers_the_slowest_recent_jobs_and_then_falls_back_to_the_least_margin() {
        let mut model = CostModel::default();
        for i in 0..500 {
            model.learn(rebuild(100), Duration::from_micros(if i % 50 == 0 { 40 } else { 20 }));
        }
        let [typical, upper] = [model.predict(rebuild(100)), model.upper_bound(rebuild(100))];
        assert!(typical > Duration::from_micros(19) && typical < Duration::from_micros(22), "{typical:?}");
        assert!(upper >= Duration::from_micros(39), "{upper:?}");
        assert!(upper > typical.mul_f32(MIN_LN_MARGIN.exp()), "{upper:?}");
        (0..5000).for_each(|_| model.shrink_margins());
        let expected = typical.mul_f32(MIN_LN_MARGIN.exp());
        assert!(model.upper_bound(rebuild(100)).abs_diff(expected) < Duration::from_nanos(10));
    }

    #[test]
    fn bounds_stay_in_order_after_measurements_of_zero_and_of_the_longest_time() {
        let mut model = CostModel::default();
        for spent in [Duration::ZERO, Duration::MAX, Duration::ZERO] {
            for kind in [WorkKind::Rebuild, WorkKind::RebuildPart, WorkKind::Snapshot, WorkKind::Probe] {
                for lights in [0, 1, 50, 1 << 30, usize::MAX] {
                    let work = Work { kind, lights };
                    for _ in 0..1000 {
                        model.learn(work, spent);
                    }
                    let (lower, typical) = (CostModel::lower_bound(work), model.predict(work));
                    let upper = model.upper_bound(work);
                    assert!(typical <= upper, "{work:?} {typical:?} {upper:?}");
                    assert!(lights < 2 || !lower.is_zero());
                    // The logarithm is rounded.
                    assert!(typical.as_nanos() as f64 >= 0.999 * lower.as_nanos() as f64, "{work:?} {typical:?}");
                }
            }
        }
    }
}

//! The time that work will take, learnt from measurements.

use std::time::Duration;

use super::clock::{Work, WorkKind};
use super::constants::MIN_SLICE_UNITS;
use super::ledger::nanos;
use crate::tree::units_of_build;

/// The cost of each kind of work, by its number of lights, learnt from measurements: a typical cost
/// for each doubling of the lights, and for each kind a margin for the slowest jobs of late.
#[derive(Clone, Debug)]
pub(crate) struct CostModel {
    kinds: [KindCosts; KINDS],
}

/// Kinds of work with costs of their own.
const KINDS: usize = 3;

/// Tree sizes are classed by their number of binary digits.
const SIZES: usize = u32::BITS as usize;

/// Nanoseconds per unit of work before the first measurement: what one core of a 2020s server took
/// (docs/benchmarks.md). A unit is one light in one level of a tree.
const INITIAL_NANOS: f64 = 25.0;

/// The initial margin: work may take twice as long as the initial costs say.
const INITIAL_MARGIN: f64 = 2.0;

/// A measurement raises the margin to at most this. So one stall does not stop all rebuilds.
const MAX_DEVIATION: f64 = 4.0;

/// A measurement changes the estimate as if it was at most this many times the present one.
const MAX_STEP: f64 = 2.0;

/// The least weight of a new measurement: about the last ten of a size count.
const MIN_LEARNING_RATE: f64 = 0.1;

/// The greatest weight of a new measurement. The first few of a size weigh more, as in a plain
/// mean.
const MAX_LEARNING_RATE: f64 = 0.5;

/// The part of the margin that is left after a frame; half of it is left after 700 frames. So a
/// single slow job does not count for ever.
const MARGIN_RETENTION: f64 = 0.999;

/// The least margin. Of 400 builds of a size the slowest took 1.3 to 1.8 times as long as the mean
/// (2-core AMD EPYC virtual machine, 2026-11-21, `costs.csv` of the budget example).
const MIN_MARGIN: f64 = 1.65;

/// The least nanoseconds per unit of work, about a tenth of what a 2020s server takes. They keep
/// frames bounded on a clock that has stopped.
const MIN_NANOS: f64 = 2.0;

/// The greatest nanoseconds of a job, some thirty years, so that sums stay within [`Duration`].
const MAX_NANOS: f64 = 1.0e18;

/// The costs of one kind of work.
#[derive(Clone, Debug)]
struct KindCosts {
    sizes: [SizeCost; SIZES],
    /// The ratio of actual to typical cost that hardly any job exceeds.
    margin: f64,
}

/// The typical cost of one kind of work in one class of sizes.
#[derive(Clone, Copy, Debug)]
struct SizeCost {
    /// Nanoseconds per unit.
    nanos: f64,
    /// The number of measurements.
    count: u32,
}

impl Default for CostModel {
    fn default() -> Self {
        let sizes = [SizeCost { nanos: INITIAL_NANOS, count: 0 }; SIZES];
        let kind = KindCosts { sizes, margin: INITIAL_MARGIN };
        Self { kinds: [kind.clone(), kind.clone(), kind] }
    }
}

/// The rebuild of a whole tree within a frame.
pub(super) fn whole(lights: usize) -> Work {
    Work { kind: WorkKind::Rebuild, lights }
}

/// The smallest slice of a build.
pub(super) fn smallest_slice(tree_lights: usize) -> Work {
    slice_of(tree_lights, MIN_SLICE_UNITS)
}

/// A slice of a build, of some units.
pub(super) fn slice_of(tree_lights: usize, units: usize) -> Work {
    let units_per_light = units_of_build(tree_lights) / tree_lights.max(1) as f64;
    Work { kind: WorkKind::Slice { tree_lights }, lights: (units as f64 / units_per_light).round().max(1.0) as usize }
}

fn kind_index(kind: WorkKind) -> usize {
    match kind {
        WorkKind::Rebuild | WorkKind::Refit => 0,
        WorkKind::Slice { .. } => 1,
        // Another thread has its own speed, and its stalls hold up no frame.
        WorkKind::Background => 2,
    }
}

/// The number of lights of the tree that is worked on.
pub(super) fn tree_lights(work: Work) -> usize {
    if let WorkKind::Slice { tree_lights } = work.kind { tree_lights } else { work.lights }
}

/// The number of units of a piece of work.
pub(crate) fn units(work: Work) -> f64 {
    match work.kind {
        WorkKind::Slice { tree_lights } => {
            units_of_build(tree_lights) / tree_lights.max(1) as f64 * work.lights.max(1) as f64
        }
        _ => units_of_build(work.lights),
    }
}

/// The class of a number of lights.
pub(super) fn size_class(lights: usize) -> usize {
    (usize::BITS - lights.max(1).leading_zeros()) as usize % SIZES
}

fn duration(nanos: f64) -> Duration {
    // The cast turns NaN into 0.
    Duration::from_nanos(nanos.min(MAX_NANOS) as u64)
}

impl CostModel {
    /// The time that the work typically takes.
    pub fn predict(&self, work: Work) -> Duration {
        duration(self.nanos(work, units(work)))
    }

    /// The time that the work hardly ever exceeds.
    pub fn upper_bound(&self, work: Work) -> Duration {
        duration(self.nanos(work, units(work)) * self.margin(work.kind))
    }

    /// The units of a slice that hardly ever takes longer than `time`, in the build of a tree.
    pub fn units_within(&self, time: Duration, tree_lights: usize) -> usize {
        let one_light = Work { kind: WorkKind::Slice { tree_lights }, lights: 1 };
        (units(one_light) * time.as_secs_f64() / self.upper_bound(one_light).as_secs_f64().max(1.0e-9)) as usize
    }

    /// The time that a slice of some units hardly ever exceeds, in the build of a tree. A slice as
    /// [`Work`] is a whole number of lights, which may be fewer units.
    pub fn slice_upper_bound(&self, units: usize, tree_lights: usize) -> Duration {
        let work = Work { kind: WorkKind::Slice { tree_lights }, lights: 1 };
        duration(self.nanos(work, units as f64) * self.margin(work.kind))
    }

    /// The time that some units of work take on the fastest machine.
    pub fn lower_bound(units: f64) -> Duration {
        duration(units * MIN_NANOS)
    }

    /// The nanoseconds that work of some units typically takes.
    pub fn nanos(&self, work: Work, units: f64) -> f64 {
        units * self.nanos_per_unit(work)
    }

    /// The ratio of actual to typical cost that hardly any job exceeds.
    pub fn margin(&self, kind: WorkKind) -> f64 {
        self.kinds[kind_index(kind)].margin
    }

    /// The nanoseconds per unit. A size that was never measured counts as the nearest size that
    /// was.
    fn nanos_per_unit(&self, work: Work) -> f64 {
        let sizes = &self.kinds[kind_index(work.kind)].sizes;
        let class = size_class(tree_lights(work));
        if sizes[class].count > 0 {
            return sizes[class].nanos;
        }
        let is_measured = |class: &usize| sizes.get(*class).is_some_and(|size| size.count > 0);
        let nearest = (0..SIZES).flat_map(|step| [class.wrapping_sub(step), class + step]).find(is_measured);
        sizes[nearest.unwrap_or(class)].nanos
    }

    /// Learns from work of some units that took `spent`. Returns the time that it was predicted to
    /// take.
    pub fn learn(&mut self, work: Work, units: f64, spent: Duration) -> Duration {
        let predicted = self.nanos(work, units);
        self.learn_ratio(work, predicted / units, nanos(spent) / predicted);
        duration(predicted)
    }

    /// Learns from work that took `ratio` times the predicted time. `typical` is the predicted time
    /// of a unit in nanoseconds.
    pub fn learn_ratio(&mut self, work: Work, typical: f64, ratio: f64) {
        let ratio = ratio.max(MIN_NANOS / typical);
        let within = |limit: f64| ratio.clamp(1.0 / limit, limit);
        let costs = &mut self.kinds[kind_index(work.kind)];
        let size = &mut costs.sizes[size_class(tree_lights(work))];
        let rate = (1.0 / (f64::from(size.count) + 1.0)).clamp(MIN_LEARNING_RATE, MAX_LEARNING_RATE);
        size.nanos = typical + rate * typical * (within(MAX_STEP) - 1.0);
        size.count = size.count.saturating_add(1);
        costs.margin = costs.margin.max(within(MAX_DEVIATION));
    }

    /// Shrinks the margins; to be called once per frame.
    pub fn shrink_margins(&mut self) {
        for costs in &mut self.kinds {
            costs.margin = (costs.margin * MARGIN_RETENTION).max(MIN_MARGIN);
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
            model.learn(rebuild(1000), units(rebuild(1000)), true_cost);
        }
        let ratio = |model: &CostModel| model.predict(rebuild(1000)).as_secs_f64() / true_cost.as_secs_f64();
        assert!((ratio(&model) - 1.0).abs() < 0.01);
        model.learn(rebuild(1000), units(rebuild(1000)), Duration::from_secs(3));
        assert!(ratio(&model) < 1.2);
        // A size that was never measured has the cost per unit of the nearest measured size.
        let larger = model.predict(rebuild(10_000)).as_secs_f64() / true_cost.as_secs_f64();
        assert!((larger - 10.0 * (10_000_f64.log2() + 1.0) / (1000_f64.log2() + 1.0)).abs() < 2.0, "{larger}");
    }

    #[test]
    fn the_first_measurements_are_averaged() {
        // Every measurement is 20 % above what was predicted, and counts as one of all so far.
        let (work, mut model) = (rebuild(100), CostModel::default());
        for rate in [MAX_LEARNING_RATE, 0.5, 1.0 / 3.0, 0.25] {
            let typical = model.nanos(work, 1.0);
            model.learn_ratio(work, typical, 1.2);
            let learned = model.nanos(work, 1.0) / typical - 1.0;
            assert!(
                (learned - 0.2 * rate.clamp(MIN_LEARNING_RATE, MAX_LEARNING_RATE)).abs() < 1.0e-9,
                "{learned} {rate}"
            );
        }
    }

    #[test]
    fn sizes_are_classed_by_powers_of_two() {
        let classes = [0, 1, 2, 3, 4, 7, 8, 1000, 1 << 20].map(size_class);
        assert_eq!(classes, [1, 1, 2, 2, 3, 3, 4, 10, 21]);
        assert_eq!(size_class(usize::MAX), usize::BITS as usize % SIZES);
    }

    #[test]
    fn all_slices_of_a_build_together_are_the_build() {
        for lights in [1, 10, 5_000, 1_000_000] {
            let whole = units(rebuild(lights));
            let slice =
                |lights_of_slice| Work { kind: WorkKind::Slice { tree_lights: lights }, lights: lights_of_slice };
            assert!((units(slice(lights)) / whole - 1.0).abs() < 1.0e-12);
            assert!((units(slice(1)) * lights as f64 / whole - 1.0).abs() < 1.0e-12);
            // A tenth of the units is a tenth of the lights.
            let tenth = slice_of(lights, (whole / 10.0) as usize);
            assert!(tenth.lights.abs_diff(lights / 10) <= 1, "{tenth:?} of {lights}");
        }
    }

    #[test]
    fn each_kind_and_size_of_work_has_a_cost_of_its_own() {
        let mut model = CostModel::default();
        let slice = Work { kind: WorkKind::Slice { tree_lights: 1000 }, lights: 100 };
        let background = Work { kind: WorkKind::Background, lights: 1000 };
        let all = [(rebuild(1000), 10.0), (rebuild(100_000), 20.0), (slice, 40.0), (background, 80.0)];
        for _ in 0..300 {
            for (work, nanos) in all {
                model.learn(work, units(work), Duration::from_nanos((nanos * units(work)) as u64));
            }
        }
        for (work, nanos) in all {
            assert!((model.nanos(work, 1.0) / nanos - 1.0).abs() < 0.01, "{work:?} {}", model.nanos(work, 1.0));
        }
        // A refit is timed with rebuilds; sizes that were not measured cost what the nearest one does.
        assert_eq!(model.nanos(Work { kind: WorkKind::Refit, lights: 1000 }, 1.0), model.nanos(rebuild(1000), 1.0));
        for lights in [2, 7, 100] {
            assert_eq!(model.nanos(rebuild(lights), 1.0), model.nanos(rebuild(1000), 1.0));
        }
        assert_eq!(model.nanos(rebuild(1 << 22), 1.0), model.nanos(rebuild(100_000), 1.0));
    }

    #[test]
    fn the_upper_bound_covers_the_slowest_recent_jobs_and_then_falls_back_to_the_least_margin() {
        let mut model = CostModel::default();
        for i in 0..500 {
            model.learn(rebuild(100), units(rebuild(100)), Duration::from_micros(if i % 50 == 0 { 40 } else { 20 }));
        }
        let [typical, upper] = [model.predict(rebuild(100)), model.upper_bound(rebuild(100))];
        assert!(typical > Duration::from_micros(19) && typical < Duration::from_micros(22), "{typical:?}");
        assert!(upper >= Duration::from_micros(39), "{upper:?}");
        assert!(upper > typical.mul_f64(MIN_MARGIN), "{upper:?}");
        (0..5000).for_each(|_| model.shrink_margins());
        let expected = typical.mul_f64(MIN_MARGIN);
        assert!(model.upper_bound(rebuild(100)).abs_diff(expected) < Duration::from_nanos(10));
    }

    #[test]
    fn bounds_stay_in_order_after_measurements_of_zero_and_of_the_longest_time() {
        let mut model = CostModel::default();
        for spent in [Duration::ZERO, Duration::MAX, Duration::ZERO] {
            for kind in [WorkKind::Rebuild, WorkKind::Slice { tree_lights: 5000 }, WorkKind::Background] {
                for lights in [0, 1, 50, 1 << 30, usize::MAX] {
                    let work = Work { kind, lights };
                    for _ in 0..1000 {
                        model.learn(work, units(work), spent);
                    }
                    let (lower, typical) = (CostModel::lower_bound(units(work)), model.predict(work));
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

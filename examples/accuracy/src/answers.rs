//! The four questions of the page, answered from the rows.

use super::settings::{Change, DEFAULT, KNOB_SAMPLES, Sampler, Setting};
use super::table::Row;
use testbed::measuring::score::Estimate;

/// A frame with one default sample per pixel takes so many milliseconds on the page.
pub const DEFAULT_FRAME_MS: f64 = 0.5;
/// The budgets of the first question, in milliseconds of the page.
pub const BUDGETS: [f64; 3] = [0.5, 1.0, 4.0];
/// The default fits its own time, whatever the rounding.
const ROUNDING: f64 = 1.0e-9;

/// A quotient of two estimates, with its 95 % confidence interval.
///
/// The interval is for independent estimates. All settings share the seeds of their pictures, so it
/// may be too wide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratio {
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

impl Ratio {
    /// The quotient of two estimates above 0. The interval is that of its logarithm, to first
    /// order.
    pub fn of(numerator: &Estimate, denominator: &Estimate) -> Self {
        let value = numerator.mean / denominator.mean;
        let spread = (numerator.half_width / numerator.mean).hypot(denominator.half_width / denominator.mean);
        Self { value, low: value * (-spread).exp(), high: value * spread.exp() }
    }

    /// Whether the interval excludes 1.
    pub fn is_difference(&self) -> bool {
        self.low > 1.0 || self.high < 1.0
    }
}

/// What a budget buys: the setting with the least error that fits.
pub struct Purchase {
    pub budget: f64,
    /// `None` if no setting fits.
    pub row: Option<Row>,
    /// The factor on the time that halves relMSE; `None` beyond the measured settings.
    pub half_rel_mse: Option<f64>,
    /// The factor on the time that halves MAPE.
    pub half_mape: Option<f64>,
}

/// A knob that is turned from the default.
pub struct Knob {
    pub name: String,
    pub time: f64,
    pub error: Ratio,
    /// The error of plain samples of the default in the same time, over that of the knob: above 1
    /// where turning the knob is worth more than more samples.
    pub gain: Ratio,
}

impl Knob {
    /// Whether both the error and the gain differ from those of the default. Where the errors are
    /// equal, the times of the world's stages would decide, which vary from run to run.
    pub fn is_difference(&self) -> bool {
        self.error.is_difference() && self.gain.is_difference()
    }
}

/// An effect that is left out.
pub struct LeftOut {
    pub name: String,
    pub time: f64,
    pub error: Ratio,
}

/// All answers.
pub struct Answers {
    /// Milliseconds of the page for one measured millisecond.
    pub scale: f64,
    /// The front of least error, by rising time.
    pub front: Vec<Row>,
    pub purchases: Vec<Purchase>,
    /// Knobs by falling gain, those without a difference last.
    pub knobs: Vec<Knob>,
    pub left_out: Vec<LeftOut>,
}

impl Answers {
    /// Answers from all rows. `None` if the default was not measured at one sample per pixel and at
    /// the samples at which knobs are turned.
    pub fn new(rows: &[Row]) -> Option<Self> {
        let at = |samples| Setting { sampler: DEFAULT, samples, change: Change::Nothing };
        let find = |setting: Setting| rows.iter().find(|row| row.setting == setting);
        let scale = DEFAULT_FRAME_MS / find(at(1.0))?.time_ms();
        let base = find(at(KNOB_SAMPLES))?;
        // Fractions of a sample are only for comparisons in equal time.
        let own: Vec<&Row> = rows.iter().filter(|row| is_plain(row) && row.setting.samples.fract() == 0.0).collect();
        let purchases = BUDGETS.map(|budget| purchase(budget, scale, &own)).into();
        let mut plain: Vec<&Row> = own.iter().filter(|row| row.setting.sampler == DEFAULT).copied().collect();
        plain.sort_by(|a, b| a.time_ms().total_cmp(&b.time_ms()));
        let mut knobs: Vec<Knob> = rows.iter().filter_map(|row| knob(row, base, &plain)).collect();
        // Knobs that make a difference come first.
        let order = |knob: &Knob| (knob.is_difference(), knob.gain.value);
        knobs.sort_by(|a, b| order(b).0.cmp(&order(a).0).then(order(b).1.total_cmp(&order(a).1)));
        let left_out = rows.iter().filter(|row| row.setting.change.is_biased()).map(|row| LeftOut {
            name: short(&row.setting),
            time: row.time_ms() / base.time_ms(),
            error: Ratio::of(&row.errors.rel_mse, &base.errors.rel_mse),
        });
        let mut front: Vec<Row> = rows.iter().filter(|row| row.on_front).cloned().collect();
        front.sort_by(|a, b| a.time_ms().total_cmp(&b.time_ms()));
        Some(Self { scale, front, purchases, knobs, left_out: left_out.collect() })
    }
}

/// Whether a row is of the library's two levels in the default frame.
pub fn is_plain(row: &Row) -> bool {
    matches!(row.setting.sampler, Sampler::TwoLevels { .. } | Sampler::ByBrdf { .. } | Sampler::WithGloss { .. })
        && row.setting.change == Change::Nothing
}

fn purchase(budget: f64, scale: f64, own: &[&Row]) -> Purchase {
    let fits = own.iter().filter(|row| row.time_ms() * scale <= budget * (1.0 + ROUNDING));
    let best = fits.min_by(|a, b| a.errors.rel_mse.mean.total_cmp(&b.errors.rel_mse.mean));
    let half = |error: fn(&Row) -> f64| {
        let best = best?;
        let points: Vec<(f64, f64)> = own.iter().map(|row| (row.time_ms(), error(row))).collect();
        Some(time_to_reach(&points, 0.5 * error(best))? / best.time_ms())
    };
    Purchase {
        budget,
        row: best.map(|row| (*row).clone()),
        half_rel_mse: half(|row| row.errors.rel_mse.mean),
        half_mape: half(|row| row.errors.mape.mean),
    }
}

/// The least time in which some setting reaches an error. Between points of the front of least
/// errors, the logarithm of the error is linear in that of the time.
fn time_to_reach(points: &[(f64, f64)], error: f64) -> Option<f64> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut last: Option<(f64, f64)> = None;
    for (time, own) in sorted {
        if last.is_some_and(|(_, least)| own >= least) {
            continue;
        }
        if own <= error {
            let Some((before, above)) = last else { return Some(time) };
            let share = (above / error).ln() / (above / own).ln();
            return Some(before * (time / before).powf(share));
        }
        last = Some((time, own));
    }
    None
}

/// A row that differs from the base by one knob other than its samples. `plain` are rows of the
/// default by time.
fn knob(row: &Row, base: &Row, plain: &[&Row]) -> Option<Knob> {
    let (own, of_base) = (row.setting, base.setting);
    if own.samples != of_base.samples || own.change.is_biased() {
        return None;
    }
    let name = match (own.sampler, of_base.sampler) {
        (Sampler::OneLevel { splits: 6, candidates: 1 }, _) => "one tree".into(),
        (sampler, of_base) if sampler == of_base && own.change != Change::Nothing => short(&own),
        (Sampler::ByBrdf { splits, candidates }, Sampler::TwoLevels { splits: s, candidates: c }) if splits == s => {
            format!("{c} → {candidates} candidates by BRDF")
        }
        (Sampler::WithGloss { splits, candidates }, Sampler::TwoLevels { splits: s, candidates: c }) if splits == s => {
            if candidates == c {
                "gloss".into()
            } else {
                format!("{c} → {candidates} candidates with gloss")
            }
        }
        (Sampler::TwoLevels { splits, candidates }, Sampler::TwoLevels { splits: s, candidates: c }) => {
            match (splits != s, candidates != c) {
                (true, false) => format!("{s} → {splits} splits"),
                (false, true) => format!("{c} → {candidates} candidates"),
                _ => return None,
            }
        }
        _ => return None,
    };
    let points: Vec<(f64, f64)> = plain.iter().map(|row| (row.time_ms(), row.errors.rel_mse.mean)).collect();
    let mean = error_at(&points, row.time_ms())?;
    let error = base.errors.rel_mse;
    let same_time = Estimate { mean, half_width: mean * error.half_width / error.mean };
    Some(Knob {
        name,
        time: row.time_ms() / base.time_ms(),
        error: Ratio::of(&row.errors.rel_mse, &error),
        gain: Ratio::of(&same_time, &row.errors.rel_mse),
    })
}

/// The error at a time, between points by rising time or beyond them: its logarithm is linear in
/// that of the time. `None` below two points.
fn error_at(points: &[(f64, f64)], time: f64) -> Option<f64> {
    let after = points.partition_point(|(own, _)| *own <= time).clamp(1, points.len().max(2) - 1);
    let (from, to) = (points.get(after - 1)?, points.get(after)?);
    let share = (time / from.0).ln() / (to.0 / from.0).ln();
    Some(from.1 * (to.1 / from.1).powf(share))
}

/// The last part of a setting's name: what differs from the default.
fn short(setting: &Setting) -> String {
    setting.name().rsplit(" / ").next().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_to_reach_an_error_lies_between_the_points_of_the_front() {
        // The point at 3 is not on the front.
        let points = [(4.0, 1.0), (1.0, 4.0), (3.0, 5.0), (16.0, 0.25)];
        let near = |a: Option<f64>, b: f64| (a.expect("within the points") - b).abs() < 1e-12;
        assert!(near(time_to_reach(&points, 4.0), 1.0));
        assert!(near(time_to_reach(&points, 2.0), 2.0));
        assert!(near(time_to_reach(&points, 0.5), 8.0));
        assert_eq!(time_to_reach(&points, 0.2), None);
    }

    #[test]
    fn the_error_at_a_time_lies_on_the_line_through_the_nearest_points() {
        let points = [(1.0, 8.0), (2.0, 4.0), (8.0, 2.0)];
        for (time, error) in [(1.0, 8.0), (0.5, 16.0), (4.0, 4.0 / 2.0_f64.sqrt()), (32.0, 1.0)] {
            assert!((error_at(&points, time).expect("three points") - error).abs() < 1e-12, "{time}");
        }
        assert_eq!(error_at(&points[..1], 1.0), None);
    }

    #[test]
    fn a_ratio_is_a_difference_if_its_interval_excludes_one() {
        let estimate = |mean, half_width| Estimate { mean, half_width };
        let ratio = Ratio::of(&estimate(1.0, 0.3), &estimate(2.0, 0.8));
        // The relative half-widths 0.3 and 0.4 add up to 0.5.
        assert!((ratio.value - 0.5).abs() < 1e-12 && (ratio.high - 0.5 * 0.5_f64.exp()).abs() < 1e-12);
        assert!(ratio.is_difference());
        assert!(!Ratio::of(&estimate(1.0, 0.9), &estimate(2.0, 0.8)).is_difference());
    }
}

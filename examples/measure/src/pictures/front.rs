//! The front of least error, and quotients of estimates.

use super::settings::{Change, DEFAULT, Sampler, Setting};
use super::table::Row;
use testbed::measuring::score::Estimate;

/// Times are scaled so that a frame with one default sample per pixel takes so many milliseconds.
const DEFAULT_FRAME_MS: f64 = 0.5;

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
}

/// The front of least error.
pub struct Front {
    /// Scaled milliseconds for one measured millisecond.
    pub scale: f64,
    /// By rising time.
    pub rows: Vec<Row>,
}

impl Front {
    /// `None` if the default was not measured at one sample per pixel.
    pub fn new(rows: &[Row]) -> Option<Self> {
        let default = Setting { sampler: DEFAULT, samples: 1.0, change: Change::Nothing };
        let scale = DEFAULT_FRAME_MS / rows.iter().find(|row| row.setting == default)?.time_ms();
        let mut rows: Vec<Row> = rows.iter().filter(|row| row.on_front).cloned().collect();
        rows.sort_by(|a, b| a.time_ms().total_cmp(&b.time_ms()));
        Some(Self { scale, rows })
    }
}

/// Whether a row is of the library's two levels in the default frame.
pub fn is_plain(row: &Row) -> bool {
    matches!(row.setting.sampler, Sampler::TwoLevels { .. } | Sampler::ByBrdf { .. } | Sampler::WithGloss { .. })
        && row.setting.change == Change::Nothing
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quotient_has_the_relative_half_widths_of_both() {
        let estimate = |mean, half_width| Estimate { mean, half_width };
        let ratio = Ratio::of(&estimate(1.0, 0.3), &estimate(2.0, 0.8));
        // The relative half-widths 0.3 and 0.4 add up to 0.5.
        assert!((ratio.value - 0.5).abs() < 1e-12 && (ratio.high - 0.5 * 0.5_f64.exp()).abs() < 1e-12);
    }
}

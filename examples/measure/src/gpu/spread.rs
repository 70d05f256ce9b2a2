//! The median and the extremes of repeated measurements.

use serde_json::{Value, json};
use std::fmt;

/// Times in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    pub median: f64,
    pub least: f64,
    pub greatest: f64,
}

impl Spread {
    /// Sums up times; `None` if there are none.
    pub fn of(seconds: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = seconds.into_iter().collect();
        sorted.sort_by(f64::total_cmp);
        let (least, greatest) = (*sorted.first()?, *sorted.last()?);
        Some(Self { median: sorted[sorted.len() / 2], least, greatest })
    }

    /// The times in milliseconds.
    pub fn to_json(self) -> Value {
        json!({ "median_ms": self.median * 1e3, "least_ms": self.least * 1e3, "greatest_ms": self.greatest * 1e3 })
    }
}

/// Milliseconds: the median (least – greatest).
impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [median, least, greatest] = [self.median, self.least, self.greatest].map(|s| Short(s * 1e3));
        write!(f, "{median} ({least} – {greatest})")
    }
}

/// A number with three significant digits.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = if self.0 > 0.0 { (2 - self.0.log10().floor() as i32).clamp(0, 5) } else { 0 };
        write!(f, "{:.*}", digits as usize, self.0)
    }
}

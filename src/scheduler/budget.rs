//! How much time a frame has for rebuilds.

use std::time::Duration;

use crate::error::BudgetError;

/// The time that one frame may spend on rebuilds, 0.3 ms by default. Refits are not optional and not counted.
///
/// Trees that do not fit are built in the background, on another thread, for the time that frames leave over of their
/// budgets; while such a tree waits, that is a quarter at least. So budgets are what all rebuilds take, on average. A
/// budget of nothing rebuilds nothing, there neither.
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

    /// From milliseconds; infinity is [`FrameBudget::UNLIMITED`].
    ///
    /// # Errors
    /// [`BudgetError`] for NaN and for less than nothing.
    pub fn from_millis(millis: f64) -> Result<Self, BudgetError> {
        if millis.is_nan() || millis < 0.0 {
            return Err(BudgetError { millis });
        }
        // What is too long for a duration is no limit.
        Ok(Duration::try_from_secs_f64(millis * 1.0e-3).map_or(Self::UNLIMITED, Self))
    }

    /// The time.
    pub const fn time(&self) -> Duration {
        self.0
    }
}

impl Default for FrameBudget {
    fn default() -> Self {
        Self(Duration::from_micros(300))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_a_time_and_nothing_else() {
        assert_eq!(FrameBudget::from_millis(0.25), Ok(FrameBudget::new(Duration::from_micros(250))));
        assert_eq!(FrameBudget::from_millis(0.0), Ok(FrameBudget::NONE));
        assert_eq!(FrameBudget::from_millis(-0.0), Ok(FrameBudget::NONE));
        assert_eq!(FrameBudget::from_millis(3.6e6), Ok(FrameBudget::new(Duration::from_secs(3600))));
        for endless in [f64::INFINITY, f64::MAX] {
            assert_eq!(FrameBudget::from_millis(endless), Ok(FrameBudget::UNLIMITED));
        }
        for bad in [f64::NAN, -1.0, f64::NEG_INFINITY] {
            assert!(FrameBudget::from_millis(bad).expect_err("no time").to_string().contains("milliseconds"));
        }
    }
}

//! The time that a frame may spend on rebuilds.

use std::time::Duration;

use crate::error::ValueError;

/// The time that one frame may spend on rebuilds, 0.3 ms by default. Refits are mandatory and do
/// not count against it.
///
/// A tree that does not fit into a frame is built in slices over several frames, or on another
/// thread. The time of that thread counts against the budgets, too: frames pay for it before they
/// serve trees of lower priority. So on average all rebuilds together take no more than the budget.
/// A budget of zero rebuilds nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameBudget(Duration);

impl FrameBudget {
    /// Every tree that is predicted to gain something is rebuilt within the frame.
    pub const UNLIMITED: Self = Self(Duration::MAX);
    /// Nothing is rebuilt.
    pub const NONE: Self = Self(Duration::ZERO);

    /// Creates a budget. A few tenths of a millisecond are usual.
    pub const fn new(time: Duration) -> Self {
        Self(time)
    }

    /// Creates a budget from milliseconds, rounded to nanoseconds. Infinity, and any time that
    /// [`Duration`] cannot hold, is [`FrameBudget::UNLIMITED`].
    ///
    /// # Errors
    /// [`ValueError`] for NaN and for negative values.
    pub fn from_millis(millis: f64) -> Result<Self, ValueError> {
        if millis.is_nan() || millis < 0.0 {
            return Err(ValueError::new("a budget in milliseconds", millis, 0.0, f64::INFINITY));
        }
        Ok(Duration::try_from_secs_f64(millis * 1.0e-3).map_or(Self::UNLIMITED, Self))
    }

    /// Returns the time of the budget; [`Duration::MAX`] means unlimited.
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
    fn milliseconds_make_a_budget_unless_they_are_negative_or_nan() {
        assert_eq!(FrameBudget::from_millis(0.25), Ok(FrameBudget::new(Duration::from_micros(250))));
        assert_eq!(FrameBudget::from_millis(0.0), Ok(FrameBudget::NONE));
        assert_eq!(FrameBudget::from_millis(-0.0), Ok(FrameBudget::NONE));
        assert_eq!(FrameBudget::from_millis(3.6e6), Ok(FrameBudget::new(Duration::from_secs(3600))));
        for unlimited in [f64::INFINITY, f64::MAX] {
            assert_eq!(FrameBudget::from_millis(unlimited), Ok(FrameBudget::UNLIMITED));
        }
        for invalid in [f64::NAN, -1.0, f64::NEG_INFINITY] {
            let error = FrameBudget::from_millis(invalid).expect_err("not a time");
            assert!(error.to_string().contains("milliseconds"), "{error}");
        }
    }
}

//! Limits on the work of one sample, as types that cannot hold a value out of range.

use std::fmt;

use crate::error::CountError;

/// The largest [`SplitCount`]. It is small because GPUs keep the candidates of a cut in registers.
pub const MAX_SPLITS: usize = 7;

/// The largest [`CandidateCount`].
pub const MAX_CANDIDATES: u32 = 32;

/// The number of clusters that may be split before a light is chosen: 0 to [`MAX_SPLITS`].
///
/// A split replaces a cluster by its children. Each one takes the time of a node and lowers the
/// noise near lights; `docs/benchmarks.md` has the curve. Fewer clusters are split where no split
/// would lower the noise. Between the extremes, one more is split where the root has only one child
/// that is worth it.
///
/// ```
/// use girandole::SplitCount;
/// assert_eq!(SplitCount::new(4)?.get(), 4);
/// assert_eq!(SplitCount::of::<4>().get(), 4); // checked at compile time
/// assert!(SplitCount::new(9).is_err());
/// # Ok::<(), girandole::CountError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SplitCount(u8);

impl SplitCount {
    /// No splits: a light is chosen by a plain walk from the root.
    pub const NONE: Self = Self(0);
    /// Six splits. A sample then takes about as long as one by pbrt-v4's formula
    /// (docs/decisions.md, 13).
    pub const DEFAULT: Self = Self(6);
    /// [`MAX_SPLITS`].
    pub const MAX: Self = Self(MAX_SPLITS as u8);

    /// At most `COUNT` splits. Does not compile above [`MAX_SPLITS`].
    pub const fn of<const COUNT: usize>() -> Self {
        const { assert!(COUNT <= MAX_SPLITS, "more splits than MAX_SPLITS") };
        Self(COUNT as u8)
    }

    /// At most `count` splits.
    ///
    /// # Errors
    /// [`CountError`] above [`MAX_SPLITS`].
    pub const fn new(count: usize) -> Result<Self, CountError> {
        if count > MAX_SPLITS {
            return Err(CountError { what: "splits", given: count, min: 0, max: MAX_SPLITS });
        }
        Ok(Self(count as u8))
    }

    /// Returns the number.
    pub const fn get(self) -> usize {
        self.0 as usize
    }
}

impl fmt::Display for SplitCount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl Default for SplitCount {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// The number of candidates that one sample is resampled from: 1 to [`MAX_CANDIDATES`].
///
/// See [`LightSampler::resample`](crate::LightSampler::resample). Each candidate takes a walk down
/// the trees and a point on a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct CandidateCount(u8);

impl CandidateCount {
    /// One candidate: resampling then equals plain sampling.
    pub const ONE: Self = Self(1);
    /// [`MAX_CANDIDATES`].
    pub const MAX: Self = Self(MAX_CANDIDATES as u8);

    /// `COUNT` candidates. Does not compile for 0 or above [`MAX_CANDIDATES`].
    pub const fn of<const COUNT: u32>() -> Self {
        const { assert!(COUNT > 0 && COUNT <= MAX_CANDIDATES, "candidates outside 1 to MAX_CANDIDATES") };
        Self(COUNT as u8)
    }

    /// `count` candidates.
    ///
    /// # Errors
    /// [`CountError`] for 0 or above [`MAX_CANDIDATES`].
    pub const fn new(count: u32) -> Result<Self, CountError> {
        if count == 0 || count > MAX_CANDIDATES {
            let max = MAX_CANDIDATES as usize;
            return Err(CountError { what: "candidates", given: count as usize, min: 1, max });
        }
        Ok(Self(count as u8))
    }

    /// Returns the number.
    pub const fn get(self) -> u32 {
        self.0 as u32
    }
}

impl fmt::Display for CandidateCount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_accept_their_limits_and_refuse_one_past_them() {
        assert_eq!(SplitCount::new(MAX_SPLITS), Ok(SplitCount::MAX));
        assert_eq!(SplitCount::new(0), Ok(SplitCount::NONE));
        assert_eq!(SplitCount::new(MAX_SPLITS + 1).map_err(|e| (e.given, e.max)), Err((8, 7)));
        assert_eq!(CandidateCount::new(MAX_CANDIDATES), Ok(CandidateCount::MAX));
        assert_eq!(CandidateCount::new(1), Ok(CandidateCount::ONE));
        for given in [0, MAX_CANDIDATES + 1] {
            assert_eq!(CandidateCount::new(given).map_err(|e| e.given), Err(given as usize));
        }
    }
}

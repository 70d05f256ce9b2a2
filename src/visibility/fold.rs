//! How the samples of a frame become part of what is known about a group of lights.
//!
//! Twin of `shaders/visibility_fold.wgsl`, with the same bits: all of it is integers.

/// Records are kept in units of 1/16, so that forgetting a part of few of them rounds little.
pub(crate) const UNITS: u32 = 16;

/// Records that are kept from earlier frames, at most. A dense frame replaces most of what was
/// known; a sparse one changes little.
pub(crate) const MEMORY: u32 = 64 * UNITS;

/// The visible records with which the mean over a block seems to start, so that one hidden sample
/// proves little.
pub(crate) const FIRST: u32 = UNITS;

/// As many records count what is known about a larger place: the group in the block of a cell, or all groups of
/// a block.
pub(crate) const PRIOR: u32 = 4 * UNITS;

/// Records of one frame, at most: more are halved until they are no more than this. It keeps the
/// products below 2^32.
pub(crate) const MAX_NEW: u32 = 256;

/// A visible record of a group of which at most one part in [`RARE`] was visible says that something has changed,
/// and all but one part in [`DOUBT`] of what was known is forgotten.
pub(crate) const RARE: u32 = 8;
/// See [`RARE`].
pub(crate) const DOUBT: u32 = 4;

/// The code of a share of 1, for groups of which nothing is known.
pub(crate) const FULL_SHARE: u8 = u8::MAX;

/// The code of the least share, 6/256. A least share of 0.05 has 5 % more noise in ten rooms, and finds a lamp that
/// comes into sight sooner.
pub(crate) const MIN_SHARE: u8 = 5;

/// What is known about a group: records in units of 1 / [`UNITS`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Known {
    pub visible: u16,
    /// Visible and hidden ones, at most [`MEMORY`].
    pub all: u16,
}

/// The share that a code stands for: 1/256 to 1, exact in f32.
#[inline(always)]
pub(crate) fn share(code: u8) -> f32 {
    (f32::from(code) + 1.0) * (1.0 / 256.0)
}

/// Adds the samples of a frame to what is known.
pub(crate) fn fold(known: Known, visible: u32, hidden: u32) -> Known {
    let (mut visible, mut hidden) = (visible, hidden);
    while visible > MAX_NEW || hidden > MAX_NEW || visible + hidden > MAX_NEW {
        visible /= 2;
        hidden /= 2;
    }
    let (mut seen, mut all) = (u32::from(known.visible), u32::from(known.all));
    if visible > 0 && RARE * seen <= all {
        seen /= DOUBT;
        all /= DOUBT;
    }
    seen += visible * UNITS;
    all += (visible + hidden) * UNITS;
    if all > MEMORY {
        Known { visible: ((seen * MEMORY + all / 2) / all) as u16, all: MEMORY as u16 }
    } else {
        Known { visible: seen as u16, all: all as u16 }
    }
}

/// The code of the visible part of so many records in units, where `prior` more of them are visible by the share of
/// a code.
fn code(visible: u32, all: u32, prior: u32, prior_code: u8) -> u8 {
    let all = all + prior;
    ((u32::from(FULL_SHARE) * visible + u32::from(prior_code) * prior + all / 2) / all) as u8
}

/// The code of the mean share over the groups of a row.
pub(crate) fn mean_code(known: &[Known]) -> u8 {
    let sum = |count: fn(&Known) -> u16| known.iter().map(|known| u32::from(count(known))).sum();
    code(sum(|known| known.visible), sum(|known| known.all), FIRST, FULL_SHARE)
}

/// The code of the share of a group, given that of a larger place.
#[inline]
pub(crate) fn share_code(known: Known, larger: u8) -> u8 {
    // Most groups have no record, and a division takes most of the time of a fold.
    match known.all {
        0 => larger.max(MIN_SHARE),
        all => code(known.visible.into(), all.into(), PRIOR, larger).max(MIN_SHARE),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_follow_the_formulas() {
        let known = |visible: u32, hidden: u32| fold(Known::default(), visible, hidden);
        for (visible, hidden) in [(0, 1), (1, 0), (1, 1), (0, 5), (40, 20), (0, 64), (64, 0)] {
            let folded = known(visible, hidden);
            assert_eq!(u32::from(folded.visible), 16 * visible);
            assert_eq!(u32::from(folded.all), 16 * (visible + hidden));
            let (visible, all) = (f64::from(visible), f64::from(visible + hidden));
            for larger in [MIN_SHARE, 77, FULL_SHARE] {
                let expected = (255.0 * visible + 4.0 * f64::from(larger)) / (all + 4.0);
                assert_eq!(share_code(folded, larger), (expected.round() as u8).max(MIN_SHARE), "{visible} {all}");
            }
        }
        // 13 of 60 records and the one that comes first.
        let mean = mean_code(&[known(0, 40), Known::default(), known(10, 5), known(3, 2)]);
        assert_eq!(mean, (255.0_f64 * 14.0 / 61.0).round() as u8);
        // Where nothing was hidden, each share is 1.
        assert_eq!((mean_code(&[known(9, 0); 512]), share_code(known(3, 0), FULL_SHARE)), (FULL_SHARE, FULL_SHARE));
    }

    #[test]
    fn what_is_known_stays_within_bounds_for_any_counts() {
        let counts = [0, 1, 255, 256, 257, 70_000, u32::MAX / 2, u32::MAX];
        for visible in counts {
            for hidden in counts {
                let mut known = Known::default();
                for _ in 0..4 {
                    known = fold(known, visible, hidden);
                    assert!(known.visible <= known.all && u32::from(known.all) <= MEMORY);
                    assert!(share_code(known, 0) >= MIN_SHARE);
                }
                // Halving loses at most the smaller count.
                let expected = f64::from(visible) / (f64::from(visible) + f64::from(hidden)).max(1.0);
                let seen = f64::from(known.visible) / f64::from(known.all.max(1));
                assert!((seen - expected).abs() < 0.01, "{visible} {hidden}: {seen}");
            }
        }
        let most = Known { visible: MEMORY as u16, all: MEMORY as u16 };
        assert_eq!(mean_code(&[most; crate::visibility::BINS]), FULL_SHARE);
    }

    #[test]
    fn a_group_that_comes_into_sight_is_soon_half_visible_and_one_that_goes_takes_its_memory() {
        let frames_until = |start: (u32, u32), each: (u32, u32), is_reached: fn(u8) -> bool| {
            let mut known = fold(Known::default(), start.0, start.1);
            (1..).find(|_| {
                known = fold(known, each.0, each.1);
                is_reached(share_code(known, MIN_SHARE))
            })
        };
        // 16 records are left after the first, 5 after the second; then one more in each frame, beside the prior's 4.
        assert_eq!(frames_until((0, 1000), (1, 0), |code| code >= 127), Some(9));
        // 64 e^(-n / 64) = 32 at n = 44.4.
        let frames = frames_until((1000, 0), (0, 1), |code| code <= 127).expect("it ends");
        assert!((38..=45).contains(&frames), "{frames}");
    }
}

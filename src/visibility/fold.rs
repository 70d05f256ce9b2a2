//! How the samples of a frame become part of what is known about a group of lights.
//!
//! Twin of `shaders/visibility_fold.wgsl`, with the same bits: all of it is integers.

/// Records are kept in units of 1/16, so that forgetting a part of few of them rounds little.
pub(crate) const UNITS: u32 = 16;

/// Records that are kept from earlier frames, at most. A dense frame replaces most of what was
/// known; a sparse one changes little.
pub(crate) const MEMORY: u32 = 64 * UNITS;

/// The visible records that each group seems to start with, so that one hidden sample proves
/// little.
pub(crate) const PRIOR: u32 = UNITS;

/// Records of one frame, at most: more are halved until they are no more than this. It keeps the
/// products below 2^32.
pub(crate) const MAX_NEW: u32 = 256;

/// The code of a share of 1, for groups of which nothing is known.
pub(crate) const FULL_SHARE: u8 = u8::MAX;

/// The code of the least share, 26/256. A least share of 0.05 has 4 to 5 % less noise in ten rooms,
/// and one of 0.2 has 10 to 12 % more. A lamp that comes into sight is found as much more slowly as
/// the least share is smaller.
pub(crate) const MIN_SHARE: u8 = 25;

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

/// Adds the samples of a frame. Returns what is known now, and the code of the share.
pub(crate) fn fold(known: Known, visible: u32, hidden: u32) -> (Known, u8) {
    let (mut visible, mut hidden) = (visible, hidden);
    while visible > MAX_NEW || hidden > MAX_NEW || visible + hidden > MAX_NEW {
        visible /= 2;
        hidden /= 2;
    }
    let visible = u32::from(known.visible) + visible * UNITS;
    let all = u32::from(known.all) + hidden * UNITS + (visible - u32::from(known.visible));
    let code = (u32::from(FULL_SHARE) * (visible + PRIOR) + (all + PRIOR) / 2) / (all + PRIOR);
    let kept = if all > MEMORY {
        Known { visible: ((visible * MEMORY + all / 2) / all) as u16, all: MEMORY as u16 }
    } else {
        Known { visible: visible as u16, all: all as u16 }
    };
    (kept, (code as u8).max(MIN_SHARE))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The code of a share, as the formula of docs/math.md has it.
    fn code(visible: f64, hidden: f64) -> u8 {
        let share = (visible + 1.0) / (visible + hidden + 1.0);
        ((255.0 * share).round() as u8).max(MIN_SHARE)
    }

    #[test]
    fn shares_of_few_samples_follow_the_formula() {
        for (visible, hidden) in [(0, 1), (1, 0), (1, 1), (0, 5), (40, 20), (0, 64), (64, 0)] {
            let (known, share) = fold(Known::default(), visible, hidden);
            assert_eq!(share, code(f64::from(visible), f64::from(hidden)), "{visible} {hidden}");
            assert_eq!(u32::from(known.visible), 16 * visible);
            assert_eq!(u32::from(known.all), 16 * (visible + hidden));
        }
    }

    #[test]
    fn what_is_known_stays_within_bounds_for_any_counts() {
        let counts = [0, 1, 255, 256, 257, 70_000, u32::MAX / 2, u32::MAX];
        for visible in counts {
            for hidden in counts {
                let mut known = Known::default();
                for _ in 0..4 {
                    let (next, share) = fold(known, visible, hidden);
                    assert!(next.visible <= next.all && u32::from(next.all) <= MEMORY);
                    assert!(share >= MIN_SHARE);
                    known = next;
                }
                // Halving loses at most the smaller count.
                let expected = f64::from(visible) / (f64::from(visible) + f64::from(hidden)).max(1.0);
                let seen = f64::from(known.visible) / f64::from(known.all.max(1));
                assert!((seen - expected).abs() < 0.01, "{visible} {hidden}: {seen}");
            }
        }
    }

    #[test]
    fn a_group_that_comes_into_sight_has_half_of_its_share_after_its_memory() {
        let (mut known, share) = fold(Known::default(), 0, 1000);
        assert_eq!(share, MIN_SHARE);
        let mut frames = 0;
        loop {
            let (next, share) = fold(known, 1, 0);
            known = next;
            frames += 1;
            if share >= 127 {
                break;
            }
        }
        // 64 (1 - e^(-n / 64)) = 32 at n = 44.4, less the prior.
        assert!((40..=45).contains(&frames), "{frames}");
    }
}

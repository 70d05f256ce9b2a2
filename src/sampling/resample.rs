//! Resampling: chooses one of several candidates in proportion to its unshadowed light, with a weight that keeps the
//! estimate unbiased.
//!
//! Twin of `light_resample` in `shaders/resample.wgsl`.
//! Source: Talbot, Cline and Egbert, Importance Resampling for Global Illumination (2005); the
//! weight W as in Bitterli et al., Spatiotemporal Reservoir Resampling (2020). Differs: all
//! candidates come from one cut, each is drawn from its own stratum (docs/math.md says why that is
//! unbiased), and one number decides about all of them, rescaled after each decision.

use glam::Vec3;

use crate::keys::LightId;
use crate::light::luminance;
use crate::math::dice::{Dice, U_STEP, clamp_unit};
use crate::sampling::cut::{Candidates, CutWork};
use crate::sampling::reservoir::{MAX_RESERVOIR_WEIGHT, Reservoir, stored};
use crate::sampling::sample::{LightSample, LightSampler};
use crate::sampling::view::WorldView;
use crate::sampling::walk::{Outcome, draw};
use crate::shading::importance::LocalShadingPoint;
use crate::shading::segment::LocalSegment;
use crate::shading::shading_point::ShadingPoint;
use crate::visibility::LearntCell;

/// The steps from one candidate's second, third and fourth random number to the next candidate's,
/// in 2^-32. They are the powers of 1 / 1.2207440846, where 1.2207440846 is the root of x^4 = x +
/// 1, and spread points evenly in three dimensions (Roberts, The Unreasonable Effectiveness of
/// Quasirandom Sequences, 2018).
pub(crate) const LATTICE: [u32; 3] = [3_518_319_155, 2_882_110_345, 2_360_945_575];

/// The most candidates of a shader.
#[cfg(feature = "gpu-plan")]
pub(crate) const MAX_CANDIDATES: u32 = 32;

/// Weights of candidates are clamped to [`MIN_WEIGHT`, `MAX_WEIGHT`] before they are multiplied by a learnt
/// share, so that their sum stays inside f32. Which weights are used changes the noise only, never the mean.
pub(crate) const MIN_WEIGHT: f32 = 1.0e-30;
/// See [`MIN_WEIGHT`].
pub(crate) const MAX_WEIGHT: f32 = 1.0e30;

impl LightSampler<'_> {
    /// Draws several candidates and keeps one of them in proportion to its unshadowed light: the
    /// luminance of `radiance * cosine / (pmf * pdf)`. One shadow ray then has the noise of many
    /// where little is shadowed. [`LightSampler::reservoir_sample`] returns its light.
    ///
    /// The first four numbers of `u` are as for [`LightSampler::sample`], whose light a single candidate
    /// has. The fifth chooses among the candidates: it is uniform in [0, 1) too. Numbers that
    /// are evenly distributed over the samples of a pixel give less noise than a hash. The reservoir has no
    /// light if no candidate sends anything to the shading point, or if there are none: count that as black.
    ///
    /// With [learnt visibility](Self::with_visibility), the light of a candidate is multiplied by the
    /// [share of its place](Self::visible_share). Clusters are split once for all candidates. Each candidate costs a
    /// walk down the trees and, if there are several, a point on a light. No memory is allocated.
    pub fn resample(&self, shading_point: &ShadingPoint, [a, b, x, y, choice]: [f32; 5], candidates: u32) -> Reservoir {
        // A single candidate needs no weight.
        let learnt = if candidates > 1 { self.learnt(shading_point) } else { None };
        let learnt = learnt.map(|learnt| (learnt, LocalSegment::of(shading_point)));
        // Without the learnt share, a candidate that is bright and hidden would be kept after all.
        let weight = |sample: &LightSample| share(learnt.as_ref(), sample) * illuminance_weight(shading_point, sample);
        let mut choice = StreamedChoice::new(choice, a);
        let (mut kept, mut kept_weight) = (None, 1.0);
        let mut visit = |outcome: Outcome, [.., x, y]: [f32; 4]| {
            let numbers = [x, y].map(stored);
            let Some(pick) = self.picked(shading_point, outcome) else { return };
            let weight = match candidates {
                1 => 1.0,
                _ => self.sample_picked(shading_point, pick, numbers).as_ref().map_or(0.0, weight),
            };
            if choice.keeps(weight) {
                (kept, kept_weight) = (Some((pick, numbers)), weight);
            }
        };
        self.on_cut(&self.view(shading_point), DrawMany { u: [a, b, x, y], candidates, visit: &mut visit });
        let weight = kept.map_or(0.0, |(pick, _)| choice.total / (candidates as f32 * kept_weight) / pick.pmf);
        self.reservoir_of_pick(kept, weight.min(MAX_RESERVOIR_WEIGHT))
    }

    /// Returns the learnt share of rays toward a sample's light that are not blocked, in (0, 1]: 1 without
    /// [learnt visibility](Self::with_visibility), and where nothing is learnt. Targets without shadow rays are
    /// multiplied by it. O(1).
    pub fn visible_share(&self, shading_point: &ShadingPoint, sample: &LightSample) -> f32 {
        let learnt = self.learnt(shading_point).map(|learnt| (learnt, LocalSegment::of(shading_point)));
        share(learnt.as_ref(), sample)
    }
}

impl Reservoir {
    /// Returns the random numbers of candidate `i` of `candidates`, from those of a sample: they are spread evenly.
    ///
    /// For programs that draw candidates one by one and [merge](Reservoir::merge) them by a target of their own.
    /// [`LightSampler::resample`] takes the same numbers. Twin of `light_candidate_numbers`.
    pub fn candidate_numbers(u: [f32; 4], i: u32, candidates: u32) -> [f32; 4] {
        if candidates <= 1 {
            return u;
        }
        // Integers and sums only, so that GPUs compute the same bits: the numbers that choose a light are hashed later.
        // The first number lies in the candidate's stratum of [0, 1), the others are shifted along a lattice.
        let fixed_point = (clamp_unit(u[0]) / U_STEP) as u64;
        let first = ((u64::from(i.min(candidates - 1)) << 24) + fixed_point) / u64::from(candidates);
        let shifted = |which: usize| {
            let sum = clamp_unit(u[which + 1]) + (i.wrapping_mul(LATTICE[which]) >> 8) as f32 * U_STEP;
            if sum >= 1.0 { sum - 1.0 } else { sum }
        };
        [first as f32 * U_STEP, shifted(0), shifted(1), shifted(2)]
    }
}

/// The learnt share of a sample; the segment is the one that it was taken for.
fn share(learnt: Option<&(LearntCell<'_>, Option<LocalSegment>)>, sample: &LightSample) -> f32 {
    match (learnt, sample.light) {
        (Some((learnt, segment)), LightId::Local { .. }) => {
            learnt.share_toward(sample.incident.toward(segment.as_ref()))
        }
        _ => 1.0,
    }
}

/// A choice among weights that come one after the other: each is kept with its share of the sum so far.
struct StreamedChoice {
    dice: Dice,
    total: f32,
}

impl StreamedChoice {
    /// `choice` decides; the bits of `more` are hashed into its low bits.
    fn new(choice: f32, more: f32) -> Self {
        Self { dice: Dice::new(choice, more), total: 0.0 }
    }

    /// Whether the next weight takes the place of the one that was kept. Never for 0.
    fn keeps(&mut self, weight: f32) -> bool {
        if weight <= 0.0 {
            return false;
        }
        self.total += weight;
        let share = weight / self.total;
        let point = self.dice.point(1.0);
        let is_kept = point < share;
        if is_kept {
            self.dice.remap(point, share)
        } else {
            self.dice.remap(point - share, 1.0 - share)
        }
        is_kept
    }
}

/// The unshadowed illuminance by a candidate in lux, times the reflectance of a glossy surface and
/// divided by its probability density.
#[allow(clippy::manual_clamp, reason = "not the same for NaN, which becomes the least")]
fn illuminance_weight(shading_point: &ShadingPoint, sample: &LightSample) -> f32 {
    let is_volume = shading_point.normal == Vec3::ZERO;
    let cosine = if is_volume { 1.0 } else { shading_point.normal.dot(sample.incident.direction) };
    let lux = luminance(sample.incident.radiance) * cosine;
    let lux = match LocalShadingPoint::gloss_of(shading_point) {
        Some(gloss) if lux > 0.0 => lux * gloss.toward(sample.incident.direction, cosine),
        _ => lux,
    };
    (lux / sample.incident.pdf / sample.pmf).max(MIN_WEIGHT).min(MAX_WEIGHT)
}

/// Draws several lights from one cut.
struct DrawMany<'v, F> {
    u: [f32; 4],
    candidates: u32,
    /// Gets what is drawn, with the numbers of the candidate.
    visit: &'v mut F,
}

impl<'a, F: FnMut(Outcome, [f32; 4])> CutWork<'a> for DrawMany<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run(self, cut: &impl Candidates<'a>, view: &WorldView<'a, '_>) {
        for i in 0..self.candidates {
            let numbers = Reservoir::candidate_numbers(self.u, i, self.candidates);
            (self.visit)(draw(cut, view, [numbers[0], numbers[1]]), numbers);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_numbers_lie_in_their_strata_and_the_others_spread_over_the_unit_cube() {
        for count in [2, 3, 7, 32] {
            for u in [[0.0; 4], [0.999_999_94; 4], [0.5, 0.1, 0.7, 0.3]] {
                let mut seen = Vec::new();
                for i in 0..count {
                    let all = Reservoir::candidate_numbers(u, i, count);
                    assert!(all.iter().all(|x| (0.0..1.0).contains(x)), "{all:?}");
                    // Strata end between 24-bit numbers, unless the count is a power of two.
                    let within = all[0] * count as f32 - i as f32;
                    assert!((-1.0e-5..1.0).contains(&within), "{all:?}");
                    // The gaps of such a lattice are more than 0.2 of an even spacing.
                    assert!(seen.iter().all(|x: &f32| (x - all[1]).abs() > 0.2 / count as f32));
                    seen.push(all[1]);
                }
            }
        }
        let nan = Reservoir::candidate_numbers([f32::NAN, -1.0, f32::INFINITY, 2.0], 3, 5);
        assert!(nan.iter().all(|x| (0.0..1.0).contains(x)), "{nan:?}");
    }

    /// The last weight that is kept.
    fn kept(weights: &[f32], choice: f32) -> Option<usize> {
        let mut streamed = StreamedChoice::new(choice, 0.3);
        (0..weights.len()).filter(|i| streamed.keeps(weights[*i])).last()
    }

    #[test]
    fn numbers_that_choose_are_divided_in_proportion_to_the_weights() {
        let rows: [&[f32]; 5] =
            [&[1.0], &[0.0, 2.0, 0.0, 1.0, 0.0], &[1.0; 32], &[1.0e-30, 1.0, 0.0, 3.0], &[1.0e30, 1.0e-30, 1.0e30]];
        let steps = 1 << 16;
        for weights in rows {
            let total: f32 = weights.iter().sum();
            let mut counts = vec![0; weights.len()];
            for step in 0..steps {
                counts[kept(weights, step as f32 / steps as f32).expect("one is positive")] += 1;
            }
            for (weight, count) in weights.iter().zip(counts) {
                // Five standard deviations of as many random numbers, and a step on each side.
                let expected = f64::from(*weight) / f64::from(total) * f64::from(steps);
                let most = 5.0 * expected.sqrt() + 2.0;
                assert!((f64::from(count) - expected).abs() <= most, "{weights:?}: {count} {expected}");
                assert!(*weight > 0.0 || count == 0, "{weights:?}");
            }
        }
        assert_eq!((kept(&[0.0; 4], 0.5), kept(&[], 0.5)), (None, None));
    }

    #[test]
    fn the_ends_of_the_unit_interval_choose_candidates_that_weigh_something() {
        let weights = [0.0, 1.0e-30, 5.0, 0.7, 0.0];
        for choice in [0.0, -1.0, f32::NAN, 0.999_999_94, 1.0, f32::INFINITY] {
            assert!(matches!(kept(&weights, choice), Some(2 | 3)), "{choice}");
        }
    }

    #[test]
    fn one_candidate_keeps_the_numbers_it_was_given() {
        let u = [0.123_456_79, 1.0e-9, 0.999_999_94, 0.0];
        assert_eq!(Reservoir::candidate_numbers(u, 0, 1), u);
    }
}

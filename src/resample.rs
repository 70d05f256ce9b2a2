//! Resampling: chooses one of several candidates in proportion to its unshadowed light, with a
//! weight that keeps the estimate unbiased.
//!
//! Twin of `shaders/resample.wgsl`. Source: Talbot, Cline and Egbert, Importance Resampling for
//! Global Illumination (2005); one pass and the weight W as in Bitterli et al., Spatiotemporal
//! Reservoir Resampling (2020). Differs: all candidates come from one cut, and each is drawn from
//! its own stratum (docs/math.md says why that is unbiased).

use crate::counts::{CandidateCount, MAX_CANDIDATES, SplitCount};
use crate::cut::{Cut, InstanceTrees, TreeView};
use crate::dice::{U_STEP, clamp_unit, hash};
use crate::emit::MIN_PDF;
use crate::light::luminance;
use crate::sample::{LightSample, LightSampler};
use crate::shading_point::ShadingPoint;
use crate::simd::{Job, with_vectors};
use crate::walk::{Outcome, draw};

/// The steps from one candidate's second, third and fourth random number to the next candidate's,
/// in 2^-32. They are the powers of 1 / 1.2207440846, where 1.2207440846 is the root of x^4 = x +
/// 1, and spread points evenly in three dimensions (Roberts, The Unreasonable Effectiveness of
/// Quasirandom Sequences, 2018).
pub(crate) const LATTICE: [u32; 3] = [3_518_319_155, 2_882_110_345, 2_360_945_575];

/// Weights of candidates are clamped to [`MIN_WEIGHT`, `MAX_WEIGHT`], so that their sum stays
/// inside f32. Which weights are used changes the noise only, never the mean.
pub(crate) const MIN_WEIGHT: f32 = 1.0e-30;
/// See [`MIN_WEIGHT`].
pub(crate) const MAX_WEIGHT: f32 = 1.0e30;

/// The candidate that [`LightSampler::resample`] kept, and its weight.
///
/// `brdf * cosine * chosen.incident.radiance * weight` estimates the light that arrives from all
/// lights, if the point is not in shadow: `weight` replaces `1 / (pmf * pdf)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reservoir {
    /// The candidate that was kept, with its own `pmf` and `pdf`.
    pub chosen: LightSample,
    /// The W of ReSTIR, in steradians for surfaces and without unit for lights without size. It is
    /// unbiased, and `1 / (pmf * pdf)` for a single candidate.
    pub weight: f32,
}

impl LightSampler<'_> {
    /// Draws several candidates and chooses one of them in proportion to its unshadowed light: the
    /// luminance of `radiance * cosine / (pmf * pdf)`. One shadow ray then has the noise of many
    /// where little is shadowed.
    ///
    /// `u` is as for [`LightSampler::sample`], which this equals for one candidate. `None` if no
    /// candidate sends anything to the shading point: count that as black.
    ///
    /// Clusters are split once for all candidates. Each candidate costs a walk down the trees and a
    /// point on a light. No memory is allocated.
    pub fn resample(&self, shading_point: &ShadingPoint, u: [f32; 4], candidates: CandidateCount) -> Option<Reservoir> {
        let count = candidates.get();
        let outcomes = with_vectors(DrawManyJob {
            root: self.root(shading_point),
            splits: self.splits,
            directional_lux: self.directional_lux(shading_point),
            u,
            count,
            instance_trees: &(self, shading_point),
        });
        let mut total = 0.0;
        let mut kept = None;
        let mut state = u.iter().rev().fold(0, |state, u| hash(u.to_bits() ^ state));
        for (i, outcome) in (0..count).zip(outcomes) {
            state = hash(state);
            let [.., a, b] = candidate_numbers(u, i, count);
            let pick = self.picked(shading_point, outcome);
            let sample = pick.and_then(|pick| self.sample_picked(shading_point, pick, [a, b]));
            let Some(sample) = sample else { continue };
            let weight = candidate_weight(shading_point, &sample);
            total += weight;
            if kept.is_none() || (state >> 8) as f32 * U_STEP * total < weight {
                kept = Some((sample, weight));
            }
        }
        kept.map(|(sample, weight)| {
            let density = (sample.pmf * sample.incident.pdf).max(MIN_PDF);
            Reservoir { chosen: sample, weight: total / (count as f32 * weight) / density }
        })
    }
}

/// The unshadowed illuminance by a candidate in lux, divided by its probability density.
#[allow(clippy::manual_clamp, reason = "not the same for NaN, which becomes the least")]
fn candidate_weight(shading_point: &ShadingPoint, sample: &LightSample) -> f32 {
    let is_volume = shading_point.normal == glam::Vec3::ZERO;
    let cosine = if is_volume { 1.0 } else { shading_point.normal.dot(sample.incident.direction) };
    let lux = luminance(sample.incident.radiance) * cosine;
    (lux / sample.incident.pdf / sample.pmf).max(MIN_WEIGHT).min(MAX_WEIGHT)
}

/// The random numbers of candidate `i`: the first lies in the candidate's stratum of [0, 1), the
/// others are shifted along a lattice.
///
/// It uses integers and sums only, so that GPUs compute the same bits: the numbers are hashed
/// later.
pub(crate) fn candidate_numbers(u: [f32; 4], i: u32, count: u32) -> [f32; 4] {
    if count == 1 {
        return u;
    }
    let fixed_point = (clamp_unit(u[0]) / U_STEP) as u32;
    let first = ((i << 24) + fixed_point) / count;
    let shifted = |which: usize| {
        let sum = clamp_unit(u[which + 1]) + (i.wrapping_mul(LATTICE[which]) >> 8) as f32 * U_STEP;
        if sum >= 1.0 { sum - 1.0 } else { sum }
    };
    [first as f32 * U_STEP, shifted(0), shifted(1), shifted(2)]
}

/// Draws several lights from one cut; the first `count` entries of the output are filled in.
struct DrawManyJob<'a, 't, T> {
    root: TreeView<'a>,
    splits: SplitCount,
    /// The illuminance by all directional lights.
    directional_lux: f32,
    u: [f32; 4],
    count: u32,
    instance_trees: &'t T,
}

impl<'a, T: InstanceTrees<'a>> Job for DrawManyJob<'a, '_, T> {
    type Output = [Outcome; MAX_CANDIDATES as usize];

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { root, splits, directional_lux, u, count, instance_trees } = self;
        let cut = Cut::new(root, splits, directional_lux, instance_trees);
        let mut outcomes = [Outcome::Nothing; MAX_CANDIDATES as usize];
        for (i, outcome) in (0..count).zip(&mut outcomes) {
            let [a, b, ..] = candidate_numbers(u, i, count);
            *outcome = draw(&cut, directional_lux, [a, b], instance_trees);
        }
        outcomes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_numbers_lie_in_their_strata_and_the_others_spread_over_the_unit_cube() {
        for count in [2, 3, 7, MAX_CANDIDATES] {
            for u in [[0.0; 4], [0.999_999_94; 4], [0.5, 0.1, 0.7, 0.3]] {
                let mut seen = Vec::new();
                for i in 0..count {
                    let all = candidate_numbers(u, i, count);
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
        let nan = candidate_numbers([f32::NAN, -1.0, f32::INFINITY, 2.0], 3, 5);
        assert!(nan.iter().all(|x| (0.0..1.0).contains(x)), "{nan:?}");
    }

    #[test]
    fn one_candidate_keeps_the_numbers_it_was_given() {
        let u = [0.123_456_79, 1.0e-9, 0.999_999_94, 0.0];
        assert_eq!(candidate_numbers(u, 0, 1), u);
    }
}

//! Several candidates for one sample: the one that probably brings most is kept, weighed so that the mean stays true.
//!
//! Twin of `shaders/resample.wgsl`. Source: Talbot, Cline and Egbert, Importance Resampling for Global Illumination
//! (2005); one pass and the weight W as in Bitterli et al., Spatiotemporal Reservoir Resampling (2020). Differs: all
//! candidates come from one cut, each from a part of its line of its own (docs/math.md says why that is unbiased).

use crate::counts::{CandidateCount, MAX_CANDIDATES, SplitCount};
use crate::dice::{U_STEP, clamp_unit, hash};
use crate::emit::MIN_PDF;
use crate::light::luminance;
use crate::sample::{LightSample, LightSampler};
use crate::shading_point::ShadingPoint;
use crate::simd::{Job, with_vectors};
use crate::walk::{Cut, Drawn, Forest, Scene};

/// Steps of the candidates' other random numbers, in 2^-32: the powers of 1 / 1.2207440846, the root of x^4 = x + 1,
/// that spread points evenly in three dimensions (Roberts, The Unreasonable Effectiveness of Quasirandom Sequences,
/// 2018).
pub(crate) const LATTICE: [u32; 3] = [3_518_319_155, 2_882_110_345, 2_360_945_575];

/// Weights of candidates are kept inside f32. Which weights are used changes the noise only, never the mean.
pub(crate) const MIN_WEIGHT: f32 = 1.0e-30;
/// See [`MIN_WEIGHT`].
pub(crate) const MAX_WEIGHT: f32 = 1.0e30;

/// One of several candidates. `brdf * cosine * sample.incident.radiance * weight` estimates the light that arrives, if
/// nothing stands between: `weight` is in place of `1 / (pmf * pdf)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reservoir {
    /// The candidate that was kept, with its own pmf and pdf.
    pub chosen: LightSample,
    /// Steradians for surfaces, a number for lights without size. The W of ReSTIR, unbiased: for a single candidate
    /// `1 / (pmf * pdf)`.
    pub weight: f32,
}

impl LightSampler<'_> {
    /// Chooses one of several candidates, in proportion to the light that each would bring without shadows: the
    /// luminance of `radiance * cosine / (pmf * pdf)`. One shadow ray then has the noise of many where little is
    /// shadowed.
    ///
    /// `u` in [0, 1) as for [`LightSampler::sample`], which this equals for one candidate. `None` if none of them brings anything, which counts as black.
    ///
    /// Clusters are opened once; each candidate costs a walk down and a point on a light. No memory is allocated.
    pub fn resample(&self, shading_point: &ShadingPoint, u: [f32; 4], candidates: CandidateCount) -> Option<Reservoir> {
        let count = candidates.get();
        let drawn = with_vectors(DrawMany {
            root: self.root(shading_point),
            splits: self.splits,
            beside: self.directional(shading_point),
            u,
            count,
            forest: &(self, shading_point),
        });
        let mut total = 0.0;
        let mut kept = None;
        let mut state = u.iter().rev().fold(0, |state, u| hash(u.to_bits() ^ state));
        for (i, drawn) in (0..count).zip(drawn) {
            state = hash(state);
            let [.., a, b] = numbers(u, i, count);
            let sample =
                self.named(shading_point, drawn).and_then(|pick| self.sample_picked(shading_point, pick, [a, b]));
            let Some(sample) = sample else { continue };
            let weight = weigh(shading_point, &sample);
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

/// What a candidate would bring without shadows, in lux, over the chance of it.
#[allow(clippy::manual_clamp, reason = "not the same for NaN, which becomes the least")]
fn weigh(shading_point: &ShadingPoint, sample: &LightSample) -> f32 {
    let is_volume = shading_point.normal == glam::Vec3::ZERO;
    let cosine = if is_volume { 1.0 } else { shading_point.normal.dot(sample.incident.direction) };
    let lux = luminance(sample.incident.radiance) * cosine;
    (lux / sample.incident.pdf / sample.pmf).max(MIN_WEIGHT).min(MAX_WEIGHT)
}

/// The random numbers of a candidate: the first from the candidate's part of [0, 1), the others moved along a lattice.
/// Integers and sums only, so that GPUs get the same bits: the numbers are hashed.
pub(crate) fn numbers(u: [f32; 4], i: u32, count: u32) -> [f32; 4] {
    if count == 1 {
        return u;
    }
    let fixed = (clamp_unit(u[0]) / U_STEP) as u32;
    let first = ((i << 24) + fixed) / count;
    let moved = |which: usize| {
        let sum = clamp_unit(u[which + 1]) + (i.wrapping_mul(LATTICE[which]) >> 8) as f32 * U_STEP;
        if sum >= 1.0 { sum - 1.0 } else { sum }
    };
    [first as f32 * U_STEP, moved(0), moved(1), moved(2)]
}

/// Draws lights from one cut; only the first `count` are filled in.
struct DrawMany<'a, 'f, F> {
    root: Scene<'a>,
    splits: SplitCount,
    beside: f32,
    u: [f32; 4],
    count: u32,
    forest: &'f F,
}

impl<'a, F: Forest<'a>> Job for DrawMany<'a, '_, F> {
    type Output = [Drawn; MAX_CANDIDATES as usize];

    #[inline(always)]
    fn run(self) -> Self::Output {
        let cut = Cut::new(self.root, self.splits, self.forest);
        let mut all = [Drawn::Nothing; MAX_CANDIDATES as usize];
        for (i, drawn) in (0..self.count).zip(&mut all) {
            let [a, b, ..] = numbers(self.u, i, self.count);
            *drawn = cut.draw(self.beside, [a, b], self.forest);
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_candidate_has_its_part_of_the_line_and_the_rest_of_the_numbers_fill_the_cube() {
        for count in [2, 3, 7, MAX_CANDIDATES] {
            for u in [[0.0; 4], [0.999_999_94; 4], [0.5, 0.1, 0.7, 0.3]] {
                let mut seen = Vec::new();
                for i in 0..count {
                    let all = numbers(u, i, count);
                    assert!(all.iter().all(|x| (0.0..1.0).contains(x)), "{all:?}");
                    // Parts end between the numbers of 24 bits, unless count is a power of two.
                    let within = all[0] * count as f32 - i as f32;
                    assert!((-1.0e-5..1.0).contains(&within), "{all:?}");
                    // The gaps of such a lattice are never small: more than 0.2 of an even spacing.
                    assert!(seen.iter().all(|x: &f32| (x - all[1]).abs() > 0.2 / count as f32));
                    seen.push(all[1]);
                }
            }
        }
        let nan = numbers([f32::NAN, -1.0, f32::INFINITY, 2.0], 3, 5);
        assert!(nan.iter().all(|x| (0.0..1.0).contains(x)), "{nan:?}");
    }

    #[test]
    fn one_candidate_keeps_the_numbers_it_was_given() {
        let u = [0.123_456_79, 1.0e-9, 0.999_999_94, 0.0];
        assert_eq!(numbers(u, 0, 1), u);
    }
}

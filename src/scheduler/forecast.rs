//! From a tree's attributes to what a rebuild of it buys: a linear map that each tree learns for itself.
//!
//! The noise inside a tree is judged by its variance sigma^2, what a rebuild buys by the logarithm of how much that has
//! risen. Bayesian linear regression: the prior was fitted over many trees and motions, `docs/math.md` has it.

use crate::tree::{Attribute, Attributes};

/// One number for each attribute.
pub(crate) const FEATURES: usize = 4;

const ATTRIBUTES: [Attribute; FEATURES] =
    [Attribute::Distance, Attribute::Overlap, Attribute::Variance, Attribute::SplittingCost];

/// Rise of ln sigma^2 per rise of the logarithm of each attribute.
const PRIOR: [f32; FEATURES] = [0.0, 0.0, 0.0, 0.89];

/// How much trees differ in that: standard deviation.
const PRIOR_DEVIATION: [f32; FEATURES] = [0.3; FEATURES];

/// Standard deviation of a rise as it is seen about what the map makes of it: by noise measured at a few points, and by
/// attributes alone.
const SEEN_NOISE: f32 = 0.6;
const TOLD_NOISE: f32 = 0.8;

/// What a tree learnt fades into the prior: half of it after 30 rebuilds, since motions change.
const KEPT: f32 = 0.977;

/// sigma^2 inside a tree that was just built, before it is known better.
const FRESH_VARIANCE: f32 = 0.03;

/// Attributes may rise from nothing, or to infinity: a rise counts as at most so much (e^5 is 150 times).
const MOST_RISE: f32 = 5.0;

/// Weight of a new look at it.
const FRESH_RATE: f32 = 0.3;

/// Less does not matter.
const LEAST_VARIANCE: f32 = 1.0e-3;

/// Attributes below this are nothing; they are of order 1.
const LEAST_ATTRIBUTE: f32 = 1.0e-6;

/// What one tree has learnt.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Forecast {
    weights: [f32; FEATURES],
    /// Of the weights.
    covariance: [[f32; FEATURES]; FEATURES],
    /// sigma^2 of the tree when it was built last.
    fresh_variance: f32,
}

impl Default for Forecast {
    fn default() -> Self {
        let covariance = std::array::from_fn(|i| std::array::from_fn(|j| prior_covariance(i, j)));
        Self { weights: PRIOR, covariance, fresh_variance: FRESH_VARIANCE }
    }
}

/// How much each attribute has risen, as a logarithm. What is no number has not.
pub(crate) fn rises(now: &Attributes, then: &Attributes) -> [f32; FEATURES] {
    ATTRIBUTES.map(|attribute| {
        let [now, then] = [now.get(attribute), then.get(attribute)];
        // Infinity to infinity is no number either.
        let rise = (now.max(LEAST_ATTRIBUTE) / then.max(LEAST_ATTRIBUTE)).ln();
        if now.is_nan() || then.is_nan() || rise.is_nan() { 0.0 } else { rise.clamp(-MOST_RISE, MOST_RISE) }
    })
}

fn dot(a: &[f32; FEATURES], b: &[f32; FEATURES]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn prior_covariance(i: usize, j: usize) -> f32 {
    if i == j { PRIOR_DEVIATION[i] * PRIOR_DEVIATION[i] } else { 0.0 }
}

/// A tree that took another's place, over the same lights.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Replaced {
    /// Attributes right after the rebuild before this one.
    pub then: Attributes,
    /// Right before this one.
    pub before: Attributes,
    /// Right after it.
    pub fresh: Attributes,
}

impl Forecast {
    /// Logarithm of how much sigma^2 has risen since the last rebuild, at least 0.
    pub fn rise(&self, rises: &[f32; FEATURES]) -> f32 {
        dot(&self.weights, rises).clamp(0.0, MOST_RISE)
    }

    /// What a rebuild takes off sigma^2.
    pub fn gain(&self, rise: f32) -> f32 {
        self.fresh_variance * rise.exp_m1()
    }

    /// Learns what a rebuild brought: from sigma^2 before and after it, if that was looked at; else from the attributes
    /// that it took away. Those tell too: what had risen since the rebuild before, and is still there, belongs to the
    /// lights, and no tree over them is without it.
    pub fn learn(&mut self, replaced: &Replaced, variances: Option<(f32, f32)>) {
        let Replaced { then, before, fresh } = replaced;
        let told = dot(&PRIOR, &rises(before, fresh));
        let (seen, noise) = match variances {
            Some((before, after)) => {
                self.learn_fresh(after);
                ((before.max(LEAST_VARIANCE) / after.max(LEAST_VARIANCE)).ln(), SEEN_NOISE)
            }
            None => (told, TOLD_NOISE),
        };
        self.learn_rise(&rises(before, then), seen, noise);
    }

    fn learn_rise(&mut self, rises: &[f32; FEATURES], seen: f32, noise: f32) {
        if !seen.is_finite() {
            return;
        }
        for i in 0..FEATURES {
            self.weights[i] = PRIOR[i] + KEPT * (self.weights[i] - PRIOR[i]);
            for j in 0..FEATURES {
                let prior = prior_covariance(i, j);
                self.covariance[i][j] = prior + KEPT * (self.covariance[i][j] - prior);
            }
        }
        let along = self.covariance.map(|row| dot(&row, rises));
        let doubt = dot(&along, rises) + noise * noise;
        let off = seen.clamp(-MOST_RISE, MOST_RISE) - dot(&self.weights, rises);
        for i in 0..FEATURES {
            self.weights[i] += along[i] / doubt * off;
            for j in 0..FEATURES {
                self.covariance[i][j] -= along[i] * along[j] / doubt;
            }
        }
    }

    fn learn_fresh(&mut self, variance: f32) {
        if variance.is_finite() && variance >= 0.0 {
            let typical = self.fresh_variance + FRESH_RATE * (variance - self.fresh_variance);
            self.fresh_variance = typical.max(LEAST_VARIANCE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attributes(values: [f32; FEATURES]) -> Attributes {
        let [distance, overlap, variance, splitting_cost] = values;
        Attributes { distance, overlap, variance, splitting_cost }
    }

    #[test]
    fn a_tree_that_gains_nothing_from_rebuilds_stops_expecting_to() {
        let mut forecast = Forecast::default();
        let (then, before) = (attributes([0.5, 0.2, 0.3, 1.5]), attributes([0.6, 0.3, 0.4, 3.0]));
        let rises = rises(&before, &then);
        let first = forecast.rise(&rises);
        assert!(first > 0.5);
        for _ in 0..60 {
            forecast.learn(&Replaced { then, before, fresh: before }, None);
        }
        assert!(forecast.rise(&rises) < 0.4 * first, "{}", forecast.rise(&rises));
        // Looking tells the same, and more.
        for _ in 0..60 {
            forecast.learn(&Replaced { then, before, fresh: before }, Some((0.5, 0.1)));
        }
        assert!((forecast.rise(&rises) / 5.0_f32.ln() - 1.0).abs() < 0.2, "{}", forecast.rise(&rises));
        assert!((forecast.gain(5.0_f32.ln()) / 0.4 - 1.0).abs() < 0.01);
    }

    #[test]
    fn it_finds_out_which_attribute_matters() {
        let mut forecast = Forecast::default();
        for i in 0..400_u32 {
            let mixed = |k: u32| (i * 4 + k).wrapping_mul(747_796_405).wrapping_mul(2_891_336_453) >> 8;
            let random = |k: u32| 4.0 * mixed(k) as f32 / (1 << 24) as f32;
            let rises = [random(1), random(2), random(3), random(4)];
            forecast.learn_rise(&rises, 0.9 * rises[1], 0.1);
        }
        // Drawn to the prior a little, since it forgets.
        assert!((forecast.weights[1] - 0.9).abs() < 0.1, "{forecast:?}");
        assert!([0, 2, 3].iter().all(|i| forecast.weights[*i].abs() < 0.1), "{forecast:?}");
    }

    #[test]
    fn what_is_no_number_says_nothing() {
        let fine = attributes([0.5; 4]);
        for odd in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, f32::MAX] {
            let odds = attributes([odd; 4]);
            for (now, then) in [(odds, fine), (fine, odds), (odds, odds)] {
                let rises = rises(&now, &then);
                assert!(rises.iter().all(|rise| rise.abs() <= MOST_RISE), "{rises:?}");
                let mut forecast = Forecast::default();
                for variances in [None, Some((odd, odd)), Some((odd, 1.0)), Some((1.0, odd))] {
                    forecast.learn(&Replaced { then, before: now, fresh: odds }, variances);
                }
                let rise = forecast.rise(&rises);
                let gain = forecast.gain(rise);
                assert!((0.0..=MOST_RISE).contains(&rise) && gain >= 0.0 && gain.is_finite(), "{odd} {rise} {gain}");
            }
        }
        assert_eq!(rises(&attributes([f32::NAN; 4]), &attributes([f32::NAN; 4])), [0.0; 4]);
    }
}

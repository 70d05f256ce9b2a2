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
const PRIOR: [f32; FEATURES] = [0.25; FEATURES];

/// How much trees differ in that: standard deviation.
const PRIOR_DEVIATION: f32 = 0.3;

/// Standard deviation of what is seen of a rise, of what the map does not explain.
const NOISE: f32 = 0.2;

/// What a tree learnt fades into the prior: half of it after 30 rebuilds, since motions change.
const KEPT: f32 = 0.977;

/// sigma^2 inside a tree that was just built, before it is known better.
const FRESH_VARIANCE: f32 = 0.3;

/// Attributes may rise from nothing, or to what is no number: a rise counts as at most so much (e^3 is twentyfold).
const MOST_RISE: f32 = 3.0;

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
        let mut covariance = [[0.0; FEATURES]; FEATURES];
        (0..FEATURES).for_each(|i| covariance[i][i] = PRIOR_DEVIATION * PRIOR_DEVIATION);
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

/// What the prior makes of rises.
pub(crate) fn prior_rise(rises: &[f32; FEATURES]) -> f32 {
    dot(&PRIOR, rises).clamp(0.0, MOST_RISE)
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

    /// A rebuild has shown what the rise was in truth.
    pub fn learn(&mut self, rises: &[f32; FEATURES], seen: f32) {
        if !seen.is_finite() {
            return;
        }
        for i in 0..FEATURES {
            self.weights[i] = PRIOR[i] + KEPT * (self.weights[i] - PRIOR[i]);
            for j in 0..FEATURES {
                let prior = if i == j { PRIOR_DEVIATION * PRIOR_DEVIATION } else { 0.0 };
                self.covariance[i][j] = prior + KEPT * (self.covariance[i][j] - prior);
            }
        }
        let along = self.covariance.map(|row| dot(&row, rises));
        let doubt = dot(&along, rises) + NOISE * NOISE;
        let off = seen.clamp(-MOST_RISE, MOST_RISE) - dot(&self.weights, rises);
        for i in 0..FEATURES {
            self.weights[i] += along[i] / doubt * off;
            for j in 0..FEATURES {
                self.covariance[i][j] -= along[i] * along[j] / doubt;
            }
        }
    }

    /// sigma^2 of the tree as it was just built.
    pub fn learn_fresh(&mut self, variance: f32) {
        if variance.is_finite() && variance >= 0.0 {
            self.fresh_variance = variance;
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
        let rises = rises(&attributes([0.6, 0.3, 0.4, 2.0]), &attributes([0.5, 0.2, 0.3, 1.5]));
        let first = forecast.rise(&rises);
        assert!(first > 0.1);
        for _ in 0..10 {
            forecast.learn(&rises, 0.0);
        }
        assert!(forecast.rise(&rises) < 0.2 * first, "{}", forecast.rise(&rises));
        for _ in 0..60 {
            forecast.learn(&rises, 2.0 * first);
        }
        assert!((forecast.rise(&rises) / first - 2.0).abs() < 0.2);
    }

    #[test]
    fn it_finds_out_which_attribute_matters() {
        let mut forecast = Forecast::default();
        for i in 0..400_u32 {
            let mixed = |k: u32| (i * 4 + k).wrapping_mul(747_796_405).wrapping_mul(2_891_336_453) >> 8;
            let random = |k: u32| mixed(k) as f32 / (1 << 24) as f32;
            let rises = [random(1), random(2), random(3), random(4)];
            forecast.learn(&rises, 1.2 * rises[1]);
        }
        // Drawn to the prior a little, since it forgets.
        assert!((0.9..1.2).contains(&forecast.weights[1]), "{forecast:?}");
        assert!([0, 2, 3].iter().all(|i| forecast.weights[*i].abs() < 0.12), "{forecast:?}");
    }

    #[test]
    fn what_is_no_number_says_nothing() {
        let fine = attributes([0.5; 4]);
        for odd in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, f32::MAX] {
            for (now, then) in [
                (attributes([odd; 4]), fine),
                (fine, attributes([odd; 4])),
                (attributes([odd; 4]), attributes([odd; 4])),
            ] {
                let rises = rises(&now, &then);
                assert!(rises.iter().all(|rise| rise.abs() <= MOST_RISE), "{rises:?}");
                let mut forecast = Forecast::default();
                forecast.learn(&rises, odd);
                forecast.learn_fresh(odd);
                let rise = forecast.rise(&rises);
                assert!((0.0..=MOST_RISE).contains(&rise) && forecast.gain(rise) >= 0.0, "{odd} {rise}");
            }
        }
        assert_eq!(rises(&attributes([f32::NAN; 4]), &attributes([f32::NAN; 4])), [0.0; 4]);
    }
}

//! Predicts how much noise a rebuild of a tree removes, from the tree's attributes. Each tree
//! learns a linear map of its own.
//!
//! The noise inside a tree is measured by its relative variance s². The noise that a rebuild
//! removes follows from the s² of a tree that was just built and from the logarithm of the rise
//! since then. The method is Bayesian linear regression; the priors were fitted over many trees and
//! motions (docs/math.md, "What a rebuild buys").

use crate::tree::{Attribute, LightTree};

/// One feature per attribute.
const FEATURES: usize = 4;

const ATTRIBUTES: [Attribute; FEATURES] =
    [Attribute::Distance, Attribute::Overlap, Attribute::Variance, Attribute::SplittingCost];

/// The prior weights: the rise of ln s² per rise of the logarithm of each attribute. Only the
/// splitting cost has one. All four attributes predict little better (R² of 0.83 held out, against
/// 0.81), mostly by distance, which also falls when lights come together; then a tree that needs a
/// rebuild would not request one.
const PRIOR: [f32; FEATURES] = [0.0, 0.0, 0.0, 1.51];

/// The prior standard deviations of the weights: how much trees differ. That of the splitting cost
/// was fitted; the others leave a tree free to learn which attributes predict its noise.
const PRIOR_DEVIATION: [f32; FEATURES] = [1.0, 0.02, 1.0, 0.55];

/// The standard deviation of a measured rise about the prediction of a tree's own map, where s² was
/// measured at two points instead of 32.
const MEASURED_DEVIATION: f32 = 0.6;

/// The same of a rise that is inferred from the attributes alone.
const INFERRED_DEVIATION: f32 = 0.8;

/// The part of what a tree has learnt that is left after a rebuild; the rest returns to the prior.
/// Half of it is left after 30 rebuilds, since motions change.
const RETENTION: f32 = 0.977;

/// ln s² of a tree that was just built: a constant, and the coefficients of the logarithm of its
/// number of lights, of the logarithm of its attribute of variance, and of the length of its mean
/// direction of emission.
const FRESH_COEFFICIENTS: [f32; 4] = [-9.46, 0.389, 4.91, 3.81];

/// The weight of one measurement in a tree's own offset from that. It follows from the standard
/// deviations of trees, 0.36, and of measurements, 0.6.
const OFFSET_RATE: f32 = 0.26;

/// Logarithms of rises count as at most this, 150 times: attributes may rise from 0, or to
/// infinity.
const MAX_RISE: f32 = 5.0;

/// ln s² stays within this of 0.
const MAX_LN_VARIANCE: f32 = 12.0;

/// Smaller attributes count as this much. Attributes are of order 1.
const MIN_ATTRIBUTE: f32 = 1.0e-3;

/// Smaller measured variances count as this much: they do not matter.
const MIN_VARIANCE: f32 = 1.0e-4;

/// The properties of a tree that predict its noise. They are finite for every tree.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TreeFeatures {
    /// The logarithms of the attributes, relative to the spread of the lights.
    /// [`Attributes`](crate::Attributes) are relative to the box around all lights, which one stray
    /// light stretches.
    attributes: [f32; FEATURES],
    /// The predicted ln s² of such a tree if it was just built.
    ln_variance: f32,
}

impl TreeFeatures {
    /// The features of a tree as of its last refit with attributes.
    pub fn of(tree: &LightTree) -> Self {
        let (cluster, attributes) = (tree.cluster(), tree.attributes());
        // The squared diagonal of the box, relative to the variance of position.
        let box_sq = cluster.aabb.extent().length_squared() / cluster.variance;
        let units = [box_sq.sqrt(), 1.0, box_sq, box_sq];
        let mut logarithms = [0.0; FEATURES];
        for i in 0..FEATURES {
            // NaN, say of lights that are all at one point, counts as the least attribute.
            logarithms[i] = (attributes.get(ATTRIBUTES[i]) * units[i]).clamp(MIN_ATTRIBUTE, 1.0 / MIN_ATTRIBUTE).ln();
            if logarithms[i].is_nan() {
                logarithms[i] = MIN_ATTRIBUTE.ln();
            }
        }
        let lights = tree.lights().len().max(1) as f32;
        let [constant, by_lights, by_variance, by_axis] = FRESH_COEFFICIENTS;
        let ln_variance =
            constant + by_lights * lights.ln() + by_variance * logarithms[2] + by_axis * cluster.axis.length();
        let ln_variance = if ln_variance.is_nan() { -MAX_LN_VARIANCE } else { ln_variance };
        Self { attributes: logarithms, ln_variance: ln_variance.clamp(-MAX_LN_VARIANCE, MAX_LN_VARIANCE) }
    }

    /// How much the logarithm of each attribute has risen since `baseline`.
    fn rises_since(&self, baseline: &Self) -> [f32; FEATURES] {
        std::array::from_fn(|i| (self.attributes[i] - baseline.attributes[i]).clamp(-MAX_RISE, MAX_RISE))
    }
}

/// The features of a tree right before and right after a rebuild.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Replacement {
    pub before: TreeFeatures,
    pub after: TreeFeatures,
}

/// What one tree has learnt about its noise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Forecast {
    weights: [f32; FEATURES],
    /// The covariance of the weights.
    covariance: [[f32; FEATURES]; FEATURES],
    /// The features right after the last rebuild.
    baseline: TreeFeatures,
    /// How much ln s² of this tree exceeds the prediction of its features when it was just built.
    ln_variance_offset: f32,
}

impl Default for Forecast {
    fn default() -> Self {
        let covariance = std::array::from_fn(|i| std::array::from_fn(|j| prior_covariance(i, j)));
        Self { weights: PRIOR, covariance, baseline: TreeFeatures::default(), ln_variance_offset: 0.0 }
    }
}

fn dot(a: &[f32; FEATURES], b: &[f32; FEATURES]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn prior_covariance(i: usize, j: usize) -> f32 {
    if i == j { PRIOR_DEVIATION[i] * PRIOR_DEVIATION[i] } else { 0.0 }
}

impl Forecast {
    /// Sets the features of the tree that was just built. Rises are relative to them.
    pub fn set_baseline(&mut self, features: TreeFeatures) {
        self.baseline = features;
    }

    /// The predicted logarithm of the rise of s² since the last rebuild, at least 0.
    pub fn rise(&self, now: &TreeFeatures) -> f32 {
        dot(&self.weights, &now.rises_since(&self.baseline)).clamp(0.0, MAX_RISE)
    }

    /// How much a rebuild lowers s² after a rise with this logarithm.
    pub fn gain(&self, rise: f32) -> f32 {
        (self.baseline.ln_variance + self.ln_variance_offset).exp() * rise.exp_m1()
    }

    /// Learns from a rebuild: from s² before and after it, if it was measured; otherwise from how
    /// far the attributes fell. If an attribute had risen and the rebuild did not lower it, the
    /// rise is a property of the lights, and every tree over them has it.
    pub fn learn(&mut self, replacement: &Replacement, variances: Option<(f32, f32)>) {
        let Replacement { before, after } = replacement;
        let rises = before.rises_since(&self.baseline);
        self.baseline = *after;
        match variances.map(|(before, after)| (before.max(MIN_VARIANCE), after.max(MIN_VARIANCE))) {
            Some((variance_before, variance_after)) => {
                self.learn_rise(&rises, (variance_before / variance_after).ln(), MEASURED_DEVIATION);
                let offset = variance_after.ln() - after.ln_variance;
                if offset.is_finite() {
                    let offset = offset.clamp(-MAX_LN_VARIANCE, MAX_LN_VARIANCE);
                    self.ln_variance_offset += OFFSET_RATE * (offset - self.ln_variance_offset);
                }
            }
            None => self.learn_rise(&rises, dot(&PRIOR, &before.rises_since(after)), INFERRED_DEVIATION),
        }
    }

    /// One step of the regression: these rises of the attributes came with this rise of ln s².
    fn learn_rise(&mut self, rises: &[f32; FEATURES], observed: f32, deviation: f32) {
        if !observed.is_finite() {
            return;
        }
        for i in 0..FEATURES {
            self.weights[i] = PRIOR[i] + RETENTION * (self.weights[i] - PRIOR[i]);
            for j in 0..FEATURES {
                let prior = prior_covariance(i, j);
                self.covariance[i][j] = prior + RETENTION * (self.covariance[i][j] - prior);
            }
        }
        let covariance_rises = self.covariance.map(|row| dot(&row, rises));
        let predictive_variance = dot(&covariance_rises, rises) + deviation * deviation;
        let residual = observed.clamp(-MAX_RISE, MAX_RISE) - dot(&self.weights, rises);
        for i in 0..FEATURES {
            self.weights[i] += covariance_rises[i] / predictive_variance * residual;
            for j in 0..FEATURES {
                self.covariance[i][j] -= covariance_rises[i] * covariance_rises[j] / predictive_variance;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Light;

    /// The features of a tree with these logarithms of attributes.
    fn features(attributes: [f32; FEATURES]) -> TreeFeatures {
        TreeFeatures { attributes, ln_variance: -3.0 }
    }

    #[test]
    fn the_predicted_rise_falls_after_rebuilds_that_gain_nothing_and_follows_measurements() {
        let mut forecast = Forecast::default();
        let (baseline, before) = (features([0.0; 4]), features([0.1, 3.0, 0.1, 0.5]));
        forecast.set_baseline(baseline);
        let first = forecast.rise(&before);
        assert!(first > 0.5);
        for _ in 0..60 {
            forecast.learn(&Replacement { before, after: before }, None);
            forecast.set_baseline(baseline);
        }
        assert!(forecast.rise(&before) < 0.5 * first, "{}", forecast.rise(&before));
        for _ in 0..60 {
            forecast.learn(&Replacement { before, after: before }, Some((0.5, 0.1)));
            forecast.set_baseline(baseline);
        }
        assert!((forecast.rise(&before) / 5.0_f32.ln() - 1.0).abs() < 0.25, "{}", forecast.rise(&before));
        assert!((forecast.gain(5.0_f32.ln()) / 0.4 - 1.0).abs() < 0.01);
    }

    #[test]
    fn the_regression_finds_the_attribute_that_causes_the_rise() {
        let mut forecast = Forecast::default();
        for i in 0..400_u32 {
            let mixed = |k: u32| (i * 4 + k).wrapping_mul(747_796_405).wrapping_mul(2_891_336_453) >> 8;
            let random = |k: u32| mixed(k) as f32 / (1 << 24) as f32;
            forecast.learn_rise(&[random(1), random(2), random(3), random(4)], 4.0 * random(3), 0.1);
        }
        // The weights stay a little nearer to the prior, since what was learnt fades.
        assert!((forecast.weights[2] - 4.0).abs() < 0.4, "{forecast:?}");
        assert!([0, 1, 3].iter().all(|i| forecast.weights[*i].abs() < 0.4), "{forecast:?}");
    }

    #[test]
    fn measurements_that_are_nan_or_infinite_leave_the_forecast_finite() {
        let extremes = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, f32::MAX];
        for variances in extremes.into_iter().flat_map(|extreme| [(extreme, extreme), (extreme, 1.0), (1.0, extreme)]) {
            let mut forecast = Forecast::default();
            let (before, after) = (features([1.0; 4]), features([0.0; 4]));
            forecast.learn(&Replacement { before, after }, Some(variances));
            let rise = forecast.rise(&before);
            let gain = forecast.gain(rise);
            assert!((0.0..=MAX_RISE).contains(&rise) && gain >= 0.0 && gain.is_finite(), "{variances:?} {rise} {gain}");
        }
    }

    #[test]
    fn features_and_forecasts_of_degenerate_trees_are_finite() {
        let lamp = |x: f32, candela: f32| Light::point(Vec3::new(x, 0.0, 0.0), Vec3::splat(candela));
        let trees = [
            vec![],
            vec![lamp(0.0, 1.0)],
            vec![lamp(3.0, 1.0); 50],
            vec![lamp(3.0, 0.0); 50],
            (0..50).map(|i| lamp(i as f32 * 1.0e-20, 1.0e-20)).collect(),
            (0..50).map(|i| lamp(i as f32 * 1.0e15, 1.0e20)).collect(),
            (0..50).map(|i| lamp(if i == 7 { 1.0e9 } else { i as f32 }, 1.0)).collect(),
        ];
        let all: Vec<_> = trees.into_iter().map(|lights| TreeFeatures::of(&LightTree::build(lights))).collect();
        for (now, baseline) in all.iter().flat_map(|a| all.iter().map(move |b| (a, b))) {
            assert!(now.ln_variance.is_finite() && now.attributes.iter().all(|a| a.is_finite()), "{now:?}");
            let mut forecast = Forecast::default();
            forecast.set_baseline(*baseline);
            let rise = forecast.rise(now);
            assert!((0.0..=MAX_RISE).contains(&rise) && forecast.gain(rise).is_finite(), "{now:?} {baseline:?}");
        }
    }
}

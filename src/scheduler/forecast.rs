//! Predicts how much noise a rebuild of a tree removes, from the tree's attributes.
//!
//! The noise inside a tree is measured by its relative variance s². Two linear models predict it:
//! ln s² of a tree that was just built, and the rise of ln s² since then. Both were fitted over
//! many trees and motions (docs/math.md, "What a rebuild buys").

use super::constants::{
    FRESH_COEFFICIENTS, FRESH_POWER, LEAST_RISE, MAX_LN_VARIANCE, MAX_RISE, MIN_ATTRIBUTE, RISE_PER_COST,
};
use crate::tree::{Attributes, LightTree};

/// The properties of a tree that predict its noise. They are finite for every tree.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TreeFeatures {
    /// The logarithm of the splitting cost relative to the spread of the lights.
    /// [`Attributes`](crate::Attributes) are relative to the box around all lights, which one stray
    /// light stretches.
    ln_cost: f32,
    /// The predicted ln s² of such a tree if it was just built.
    ln_variance: f32,
}

impl TreeFeatures {
    /// The features of a tree as of its last refit with attributes.
    pub fn of(tree: &LightTree) -> Self {
        let cluster = tree.cluster();
        let spread = cluster.aabb.extent().length_squared() / cluster.variance;
        Self::new(&tree.attributes(), spread, cluster.axis.length(), tree.light_count())
    }

    /// The features of a tree of so many lights with these attributes. `spread` is the squared diagonal of its
    /// box, relative to the variance of position, and `axis_length` that of the mean direction of emission.
    pub fn new(attributes: &Attributes, spread: f32, axis_length: f32, lights: usize) -> Self {
        let logarithm = |attribute: f32| {
            let clamped = (attribute * spread).clamp(MIN_ATTRIBUTE, 1.0 / MIN_ATTRIBUTE);
            // NaN, say of lights that are all at one point, counts as the least attribute.
            if clamped.is_nan() { MIN_ATTRIBUTE.ln() } else { clamped.ln() }
        };
        let lights = lights.max(1) as f32;
        let [constant, by_lights, by_variance, by_axis] = FRESH_COEFFICIENTS;
        let ln_variance =
            constant + by_lights * lights.ln() + by_variance * logarithm(attributes.variance) + by_axis * axis_length;
        Self {
            ln_cost: logarithm(attributes.splitting_cost),
            ln_variance: ln_variance.clamp(-MAX_LN_VARIANCE, MAX_LN_VARIANCE),
        }
    }

    /// The features of a tree with this logarithm of the splitting cost.
    #[cfg(test)]
    pub fn of_cost(ln_cost: f32) -> Self {
        Self { ln_cost, ..Self::default() }
    }

    /// The predicted logarithm of the rise of s² since the tree had the features `built`, right
    /// after it was built. At least 0.
    pub fn rise_since(&self, built: &Self) -> f32 {
        (RISE_PER_COST * (self.ln_cost - built.ln_cost)).clamp(0.0, MAX_RISE)
    }

    /// The value of what a rebuild gains after a rise with this logarithm, for a tree that had
    /// these features right after it was built. In proportion to the decrease of s², but for the
    /// powers and limits in `constants.rs`.
    pub fn gain(&self, rise: f32) -> f32 {
        (FRESH_POWER * self.ln_variance).exp() * rise.max(LEAST_RISE).exp_m1()
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Light;

    #[test]
    fn the_gain_follows_from_the_rise_of_the_splitting_cost() {
        let built = TreeFeatures { ln_cost: 0.5, ln_variance: -3.0 };
        let now = TreeFeatures { ln_cost: 0.5 + 2.0_f32.ln(), ln_variance: 7.0 };
        let rise = now.rise_since(&built);
        assert!((rise - RISE_PER_COST * 2.0_f32.ln()).abs() < 1.0e-6, "{rise}");
        // s² was e^-3, of which the power 0.4 counts, and has been multiplied by 2^1.51.
        let gain = built.gain(rise);
        assert!((gain / (0.301_19 * (2.848_1 - 1.0)) - 1.0).abs() < 1.0e-3, "{gain}");
        assert_eq!(built.rise_since(&now), 0.0, "a cost that fell is no rise");
        // Small rises count as one of 35 %.
        assert_eq!(built.gain(0.0), built.gain(0.3));
        assert!((built.gain(0.0) / (0.301_19 * 0.349_86) - 1.0).abs() < 1.0e-3);
    }

    /// The formulas of docs/math.md, "What a rebuild buys", with the coefficients as they stand there.
    #[test]
    fn features_are_those_of_the_fitted_models() {
        let spot = |i: u32| {
            let at = Vec3::new((i * 37 % 64) as f32, (i * 11 % 9) as f32, (i * 23 % 40) as f32);
            Light::spot(at, Vec3::new(0.3, -1.0, 0.01 * i as f32), 0.2, 1.0, Vec3::splat(1.0 + (i % 5) as f32))
        };
        for count in [40, 700] {
            let tree = LightTree::build((0..count).map(spot).collect());
            let (cluster, attributes) = (tree.cluster(), tree.attributes());
            let spread = f64::from(cluster.aabb.extent().length_squared()) / f64::from(cluster.variance);
            let [cost, variance] =
                [attributes.splitting_cost, attributes.variance].map(|a| (f64::from(a) * spread).ln());
            let axis = f64::from(cluster.axis.length());
            assert!(axis > 0.5 && cost.abs() > 0.01 && variance.abs() > 0.01, "{axis} {cost} {variance}");
            let fresh = -9.46 + 0.389 * f64::from(count).ln() + 4.91 * variance + 3.81 * axis;
            let features = TreeFeatures::of(&tree);
            assert!((f64::from(features.ln_cost) - cost).abs() < 1.0e-4, "{features:?} {cost}");
            assert!((f64::from(features.ln_variance) - fresh).abs() < 1.0e-3, "{features:?} {fresh}");
        }
    }

    #[test]
    fn features_of_degenerate_trees_are_finite() {
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
        for (now, built) in all.iter().flat_map(|a| all.iter().map(move |b| (a, b))) {
            assert!(now.ln_variance.is_finite() && now.ln_cost.is_finite(), "{now:?}");
            let rise = now.rise_since(built);
            assert!((0.0..=MAX_RISE).contains(&rise) && built.gain(rise).is_finite(), "{now:?} {built:?}");
        }
    }
}

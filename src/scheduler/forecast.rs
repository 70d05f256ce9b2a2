//! Predicts how much more noise a tree has than right after its last build, from its attributes.
//!
//! The noise inside a tree is measured by its relative variance s². A linear model predicts the rise of
//! ln s² from that of the splitting cost. It was fitted over many trees and motions (docs/math.md,
//! "What a rebuild buys").

use super::constants::{LEAST_RISE, MAX_RISE, MIN_ATTRIBUTE, RISE_PER_COST};
use crate::tree::{Attributes, LightTree};

/// The logarithm of a tree's splitting cost relative to the spread of its lights. Finite for every tree.
///
/// [`Attributes`](crate::Attributes) are relative to the box around all lights, which one stray
/// light stretches.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LnCost(f32);

impl LnCost {
    /// That of a tree as of its last refit with attributes.
    pub fn of(tree: &LightTree) -> Self {
        let cluster = tree.cluster();
        Self::new(&tree.attributes(), cluster.aabb.extent().length_squared() / cluster.variance)
    }

    /// That of a tree with these attributes. `spread` is the squared diagonal of its box, relative to the
    /// variance of position.
    pub fn new(attributes: &Attributes, spread: f32) -> Self {
        let clamped = (attributes.splitting_cost * spread).clamp(MIN_ATTRIBUTE, 1.0 / MIN_ATTRIBUTE);
        // NaN, say of lights that are all at one point, counts as the least attribute.
        Self(if clamped.is_nan() { MIN_ATTRIBUTE.ln() } else { clamped.ln() })
    }

    /// The predicted logarithm of the rise of s² since the tree was built, with the cost `built`. At
    /// least 0.
    pub fn rise_since(self, built: Self) -> f32 {
        (RISE_PER_COST * (self.0 - built.0)).clamp(0.0, MAX_RISE)
    }
}

/// The value of what a rebuild gains in a frame, after a rise with this logarithm: in proportion to the
/// decrease of s², but for the limit in `constants.rs`.
pub(super) fn gain(rise: f32) -> f32 {
    rise.max(LEAST_RISE).exp_m1()
}

#[cfg(test)]
impl From<f32> for LnCost {
    fn from(ln_cost: f32) -> Self {
        Self(ln_cost)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Light;

    #[test]
    fn the_gain_follows_from_the_rise_of_the_splitting_cost() {
        let (built, now) = (LnCost(0.5), LnCost(0.5 + 2.0_f32.ln()));
        let rise = now.rise_since(built);
        assert!((rise - RISE_PER_COST * 2.0_f32.ln()).abs() < 1.0e-6, "{rise}");
        // s² has been multiplied by 2^1.51.
        assert!((gain(rise) / (2.848_1 - 1.0) - 1.0).abs() < 1.0e-3, "{rise}");
        assert_eq!(built.rise_since(now), 0.0, "a cost that fell is no rise");
        // Small rises count as one of 35 %.
        assert_eq!(gain(0.0), gain(0.3));
        assert!((gain(0.0) / 0.349_86 - 1.0).abs() < 1.0e-3);
    }

    /// The formula of docs/math.md, "The forecast in use".
    #[test]
    fn the_cost_is_relative_to_the_spread_of_the_lights() {
        let spot = |i: u32| {
            let at = Vec3::new((i * 37 % 64) as f32, (i * 11 % 9) as f32, (i * 23 % 40) as f32);
            Light::spot(at, Vec3::new(0.3, -1.0, 0.01 * i as f32), 0.2, 1.0, Vec3::splat(1.0 + (i % 5) as f32))
        };
        for count in [40, 700] {
            let tree = LightTree::build((0..count).map(spot).collect());
            let (cluster, attributes) = (tree.cluster(), tree.attributes());
            let spread = f64::from(cluster.aabb.extent().length_squared()) / f64::from(cluster.variance);
            let cost = (f64::from(attributes.splitting_cost) * spread).ln();
            assert!(cost.abs() > 0.01 && (f64::from(LnCost::of(&tree).0) - cost).abs() < 1.0e-4, "{cost}");
        }
    }

    #[test]
    fn costs_of_degenerate_trees_are_finite() {
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
        let all: Vec<_> = trees.into_iter().map(|lights| LnCost::of(&LightTree::build(lights))).collect();
        for (now, built) in all.iter().flat_map(|a| all.iter().map(move |b| (*a, *b))) {
            let rise = now.rise_since(built);
            assert!(
                now.0.is_finite() && (0.0..=MAX_RISE).contains(&rise) && gain(rise).is_finite(),
                "{now:?} {built:?}"
            );
        }
    }
}

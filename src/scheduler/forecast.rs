//! From a tree's attributes to what a rebuild buys: a linear map that each tree learns for itself.
//!
//! The noise inside a tree is judged by its relative variance s^2; what a rebuild buys follows from that of a tree that
//! was just built and from the logarithm of how much it has risen since. Bayesian linear regression; the priors were
//! fitted over many trees and motions (docs/math.md, "What a rebuild buys").

use crate::tree::{Attribute, LightTree};

/// One number for each attribute.
const FEATURES: usize = 4;

const ATTRIBUTES: [Attribute; FEATURES] =
    [Attribute::Distance, Attribute::Overlap, Attribute::Variance, Attribute::SplittingCost];

/// Rise of ln s^2 per rise of each attribute's logarithm: of the splitting cost alone. All four foretell little better
/// (R^2 0.83 held out, and 0.81), mostly by distance, which also falls when lights come together; then a tree that went
/// bad would not ask.
const PRIOR: [f32; FEATURES] = [0.0, 0.0, 0.0, 1.51];

/// How much trees differ in that: standard deviation. That of cost was fitted; the others leave a tree to learn for
/// itself what else tells.
const PRIOR_DEVIATION: [f32; FEATURES] = [1.0, 0.02, 1.0, 0.55];

/// Standard deviation of a rise about what a tree's own map makes of it: of one whose s^2 was looked at, at two points
/// instead of 32; and of one that is told by the attributes alone.
const SEEN_NOISE: f32 = 0.6;
const TOLD_NOISE: f32 = 0.8;

/// What a tree learnt fades into the prior: half of it after 30 rebuilds, since motions change.
const KEPT: f32 = 0.977;

/// ln s^2 of a tree that was just built: a constant, and per logarithm of its lights, logarithm of its attribute of
/// variance, and length of its mean direction of emission.
const FRESH: [f32; 4] = [-9.46, 0.389, 4.91, 3.81];

/// How much of what a look at s^2 differs from that is the tree's own: the rest is the look's. From the deviations 0.36
/// of trees and 0.6 of looks.
const FRESH_RATE: f32 = 0.26;

/// A rise counts as at most so much (e^5 is 150 times): attributes may rise from nothing, or to infinity.
const MAX_RISE: f32 = 5.0;

/// ln s^2 stays within this of 0.
const MAX_LN_VARIANCE: f32 = 12.0;

/// Attributes below this are nothing; they are of order 1.
const MIN_ATTRIBUTE: f32 = 1.0e-3;

/// Less variance does not matter.
const MIN_VARIANCE: f32 = 1.0e-4;

/// A tree's shape, in the numbers that foretell its noise.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Signs {
    /// Logarithms of the attributes, relative to the lights' own spread: the box around all, to which
    /// [`Attributes`](crate::Attributes) are relative, is stretched by one stray light.
    attributes: [f32; FEATURES],
    /// Logarithm of s^2 of such a tree.
    ln_variance: f32,
}

impl Signs {
    /// Of a tree as it was last refitted with attributes. Finite, whatever the tree is like.
    pub fn of(tree: &LightTree) -> Self {
        let (cluster, attributes) = (tree.cluster(), tree.attributes());
        // The box's diagonal squared, per variance of position.
        let box_sq = cluster.aabb.extent().length_squared() / cluster.variance;
        let units = [box_sq.sqrt(), 1.0, box_sq, box_sq];
        let mut logarithms = [0.0; FEATURES];
        for i in 0..FEATURES {
            // Lights all at one point, or an attribute that is no number: nothing.
            logarithms[i] = (attributes.get(ATTRIBUTES[i]) * units[i]).clamp(MIN_ATTRIBUTE, 1.0 / MIN_ATTRIBUTE).ln();
            if logarithms[i].is_nan() {
                logarithms[i] = MIN_ATTRIBUTE.ln();
            }
        }
        let lights = tree.lights().len().max(1) as f32;
        let ln_variance =
            FRESH[0] + FRESH[1] * lights.ln() + FRESH[2] * logarithms[2] + FRESH[3] * cluster.axis.length();
        let ln_variance = if ln_variance.is_nan() { -MAX_LN_VARIANCE } else { ln_variance };
        Self { attributes: logarithms, ln_variance: ln_variance.clamp(-MAX_LN_VARIANCE, MAX_LN_VARIANCE) }
    }

    /// By how much each attribute has risen.
    fn rises(&self, then: &Self) -> [f32; FEATURES] {
        std::array::from_fn(|i| (self.attributes[i] - then.attributes[i]).clamp(-MAX_RISE, MAX_RISE))
    }
}

/// A tree that took another's place, over the same lights.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Replaced {
    /// Right before.
    pub before: Signs,
    /// Right after.
    pub fresh: Signs,
}

/// What one tree has learnt.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Forecast {
    weights: [f32; FEATURES],
    /// Of the weights.
    covariance: [[f32; FEATURES]; FEATURES],
    /// Right after the last rebuild.
    then: Signs,
    /// What ln s^2 of a tree just built is, beyond what its signs tell.
    own: f32,
}

impl Default for Forecast {
    fn default() -> Self {
        let covariance = std::array::from_fn(|i| std::array::from_fn(|j| prior_covariance(i, j)));
        Self { weights: PRIOR, covariance, then: Signs::default(), own: 0.0 }
    }
}

fn dot(a: &[f32; FEATURES], b: &[f32; FEATURES]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn prior_covariance(i: usize, j: usize) -> f32 {
    if i == j { PRIOR_DEVIATION[i] * PRIOR_DEVIATION[i] } else { 0.0 }
}

impl Forecast {
    /// A tree was built: what is to come is judged by this.
    pub fn start(&mut self, fresh: Signs) {
        self.then = fresh;
    }

    /// Logarithm of how much s^2 has risen since the last rebuild, at least 0.
    pub fn rise(&self, now: &Signs) -> f32 {
        dot(&self.weights, &now.rises(&self.then)).clamp(0.0, MAX_RISE)
    }

    /// What a rebuild takes off s^2 that has risen so much.
    pub fn gain(&self, rise: f32) -> f32 {
        (self.then.ln_variance + self.own).exp() * rise.exp_m1()
    }

    /// Learns what a rebuild brought: from s^2 before and after it, if that was looked at; else from the attributes
    /// that it took away. Those tell too: what had risen since the rebuild before, and is still there, belongs to the
    /// lights, and no tree over them is without it.
    pub fn learn(&mut self, replaced: &Replaced, variances: Option<(f32, f32)>) {
        let Replaced { before, fresh } = replaced;
        let rises = before.rises(&self.then);
        self.then = *fresh;
        match variances.map(|(before, after)| (before.max(MIN_VARIANCE), after.max(MIN_VARIANCE))) {
            Some((before, after)) => {
                self.learn_rise(&rises, (before / after).ln(), SEEN_NOISE);
                let own = after.ln() - fresh.ln_variance;
                if own.is_finite() {
                    self.own += FRESH_RATE * (own.clamp(-MAX_LN_VARIANCE, MAX_LN_VARIANCE) - self.own);
                }
            }
            None => self.learn_rise(&rises, dot(&PRIOR, &before.rises(fresh)), TOLD_NOISE),
        }
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
        let off = seen.clamp(-MAX_RISE, MAX_RISE) - dot(&self.weights, rises);
        for i in 0..FEATURES {
            self.weights[i] += along[i] / doubt * off;
            for j in 0..FEATURES {
                self.covariance[i][j] -= along[i] * along[j] / doubt;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Light;

    /// Of a tree whose attributes are e to the power of these.
    fn signs(attributes: [f32; FEATURES]) -> Signs {
        Signs { attributes, ln_variance: -3.0 }
    }

    #[test]
    fn a_tree_that_gains_nothing_from_rebuilds_stops_expecting_to() {
        let mut forecast = Forecast::default();
        let (then, before) = (signs([0.0; 4]), signs([0.1, 3.0, 0.1, 0.5]));
        forecast.start(then);
        let first = forecast.rise(&before);
        assert!(first > 0.5);
        for _ in 0..60 {
            forecast.learn(&Replaced { before, fresh: before }, None);
            forecast.start(then);
        }
        assert!(forecast.rise(&before) < 0.5 * first, "{}", forecast.rise(&before));
        // Looking tells the same, and more.
        for _ in 0..60 {
            forecast.learn(&Replaced { before, fresh: before }, Some((0.5, 0.1)));
            forecast.start(then);
        }
        assert!((forecast.rise(&before) / 5.0_f32.ln() - 1.0).abs() < 0.25, "{}", forecast.rise(&before));
        assert!((forecast.gain(5.0_f32.ln()) / 0.4 - 1.0).abs() < 0.01);
    }

    #[test]
    fn it_finds_out_which_attribute_matters() {
        let mut forecast = Forecast::default();
        for i in 0..400_u32 {
            let mixed = |k: u32| (i * 4 + k).wrapping_mul(747_796_405).wrapping_mul(2_891_336_453) >> 8;
            let random = |k: u32| mixed(k) as f32 / (1 << 24) as f32;
            forecast.learn_rise(&[random(1), random(2), random(3), random(4)], 4.0 * random(3), 0.1);
        }
        // Drawn to the prior a little, since it forgets.
        assert!((forecast.weights[2] - 4.0).abs() < 0.4, "{forecast:?}");
        assert!([0, 1, 3].iter().all(|i| forecast.weights[*i].abs() < 0.4), "{forecast:?}");
    }

    #[test]
    fn what_is_no_number_says_nothing() {
        let odds = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, f32::MAX];
        for (before, after) in odds.into_iter().flat_map(|odd| [(odd, odd), (odd, 1.0), (1.0, odd)]) {
            let mut forecast = Forecast::default();
            let (before_signs, fresh) = (signs([1.0; 4]), signs([0.0; 4]));
            forecast.learn(&Replaced { before: before_signs, fresh }, Some((before, after)));
            let rise = forecast.rise(&before_signs);
            let gain = forecast.gain(rise);
            assert!(
                (0.0..=MAX_RISE).contains(&rise) && gain >= 0.0 && gain.is_finite(),
                "{before} {after} {rise} {gain}"
            );
        }
    }

    #[test]
    fn signs_of_any_tree_are_numbers() {
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
        let all: Vec<_> = trees.into_iter().map(|lights| Signs::of(&LightTree::build(lights))).collect();
        for (a, b) in all.iter().flat_map(|a| all.iter().map(move |b| (a, b))) {
            assert!(a.ln_variance.is_finite() && a.attributes.iter().all(|a| a.is_finite()), "{a:?}");
            let mut forecast = Forecast::default();
            forecast.start(*b);
            let rise = forecast.rise(a);
            assert!((0.0..=MAX_RISE).contains(&rise) && forecast.gain(rise).is_finite(), "{a:?} {b:?}");
        }
    }
}

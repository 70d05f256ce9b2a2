//! From the attributes' history to a decision: is a rebuild worth its time?
//!
//! Algorithms 1 and 2 of SS. Pure: nothing here knows of trees, time or budgets.

use crate::error::WorldError;
use crate::tree::{Attribute, Attributes};

/// Where the least value since the last rebuild is 0, a ratio to it means nothing: then any value above this asks for
/// a rebuild. Attributes are of order 1, and rounding leaves about 1e-7 of them.
pub const ATTRIBUTE_FLOOR: f32 = 1.0e-6;

/// How much worse an attribute must be than after the last rebuild before [`Policy::Budgeted`] asks for another.
/// Rebuilds of the same lights differ by less; without it trees that stand still would be rebuilt for ever.
const WORSE: f32 = 0.02;

/// What an instance wants for its tree. The variants are ordered by how demanding they are; a tree that several
/// instances share follows the most demanding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Policy {
    /// Its lights never change: an attempt to change them is refused while all instances are static.
    Static,
    /// Only ever refitted: cheap lights, or lights that move as one. The attributes are not measured.
    RefitOnly,
    /// The scheduler weighs what a rebuild buys against all others.
    #[default]
    Budgeted,
    /// Algorithm 1 of SS: asks for a rebuild when the attribute exceeds its least value by `factor` standard deviations.
    Deviation {
        /// Which attribute is watched.
        attribute: Attribute,
        /// Its standard deviation over rebuilt trees, at least 0.
        deviation: f32,
        /// S of SS, at least 0.
        factor: f32,
    },
    /// Algorithm 2 of SS: asks for a rebuild when the attribute exceeds `factor` times its least value.
    Ratio {
        /// Which attribute is watched.
        attribute: Attribute,
        /// S of SS, at least 1; 1.1 is ten percent.
        factor: f32,
    },
    /// Rebuilt whenever its lights change, before all others.
    AlwaysRebuild,
}

impl Policy {
    /// Refuses thresholds that are not numbers.
    pub(crate) fn validate(&self) -> Result<(), WorldError> {
        let check = |what, value: f32, min: f32| {
            let fine = value.is_finite() && value >= min;
            if fine { Ok(()) } else { Err(WorldError::Policy { what, value, min }) }
        };
        match *self {
            Self::Deviation { deviation, factor, .. } => {
                check("deviation", deviation, 0.0)?;
                check("factor", factor, 0.0)
            }
            Self::Ratio { factor, .. } => check("factor", factor, 1.0),
            _ => Ok(()),
        }
    }

    /// Whether the policy can ever lead to a rebuild.
    pub(crate) fn may_rebuild(&self) -> bool {
        !matches!(self, Self::Static | Self::RefitOnly)
    }
}

/// What a tree's attributes have been since its last rebuild.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct History {
    /// Right after the last rebuild.
    pub rebuilt: Attributes,
    /// The least of each since then.
    pub least: Attributes,
}

impl History {
    /// Starts anew with a rebuilt tree.
    pub fn start(rebuilt: Attributes) -> Self {
        Self { rebuilt, least: rebuilt }
    }

    /// Takes note of a refit.
    pub fn observe(&mut self, now: &Attributes) {
        let least = &mut self.least;
        least.distance = least.distance.min(now.distance);
        least.overlap = least.overlap.min(now.overlap);
        least.variance = least.variance.min(now.variance);
        least.splitting_cost = least.splitting_cost.min(now.splitting_cost);
    }

    /// By how much the tree is worse than when it was rebuilt: the largest relative rise of any attribute, at least 0.
    pub fn worsening(&self, now: &Attributes) -> f32 {
        [Attribute::Distance, Attribute::Overlap, Attribute::Variance, Attribute::SplittingCost]
            .into_iter()
            .map(|a| (now.get(a) - self.rebuilt.get(a)) / self.rebuilt.get(a).max(ATTRIBUTE_FLOOR))
            .fold(0.0, f32::max)
    }
}

/// Whether a policy asks for a rebuild of a tree that was just refitted.
///
/// `history` must have observed `now` already, so that a value below the former least is its own least.
pub fn wants_rebuild(policy: &Policy, history: &History, now: &Attributes) -> bool {
    match *policy {
        Policy::Static | Policy::RefitOnly => false,
        Policy::AlwaysRebuild => true,
        Policy::Deviation { attribute, deviation, factor } => {
            now.get(attribute) > history.least.get(attribute) + factor * deviation
        }
        Policy::Ratio { attribute, factor } => {
            let least = history.least.get(attribute);
            now.get(attribute) > if least > 0.0 { least * factor } else { ATTRIBUTE_FLOOR }
        }
        Policy::Budgeted => history.worsening(now) > WORSE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn overlap(value: f32) -> Attributes {
        Attributes { overlap: value, ..Attributes::default() }
    }

    fn run(policy: Policy, values: &[f32]) -> Vec<bool> {
        let mut history = History::start(overlap(values[0]));
        values[1..]
            .iter()
            .map(|v| {
                let now = overlap(*v);
                history.observe(&now);
                let rebuild = wants_rebuild(&policy, &history, &now);
                if rebuild {
                    history = History::start(now);
                }
                rebuild
            })
            .collect()
    }

    #[test]
    fn algorithm_1_rebuilds_past_the_least_value_plus_deviations() {
        let policy = Policy::Deviation { attribute: Attribute::Overlap, deviation: 0.1, factor: 1.0 };
        // The least value sinks to 0.4, so 0.49 stays within one deviation of 0.1 and 0.51 does not.
        assert_eq!(run(policy, &[0.5, 0.59, 0.4, 0.49, 0.51, 0.6]), [false, false, false, true, false]);
    }

    #[test]
    fn algorithm_2_rebuilds_past_a_ratio_and_knows_what_zero_means() {
        let policy = Policy::Ratio { attribute: Attribute::Overlap, factor: 1.1 };
        assert_eq!(run(policy, &[1.0, 1.09, 1.11, 1.2, 1.23]), [false, true, false, true]);
        assert_eq!(run(policy, &[0.0, 0.0, 1e-7, 0.01, 0.011]), [false, false, true, false]);
    }

    #[test]
    fn bad_thresholds_are_refused() {
        let attribute = Attribute::Variance;
        assert!(Policy::Ratio { attribute, factor: f32::NAN }.validate().is_err());
        assert!(Policy::Ratio { attribute, factor: 0.99 }.validate().is_err());
        assert!(Policy::Ratio { attribute, factor: 1.0 }.validate().is_ok());
        assert!(Policy::Deviation { attribute, deviation: -1.0, factor: 1.0 }.validate().is_err());
    }
}

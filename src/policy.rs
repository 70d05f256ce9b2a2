//! From the attributes' history to a decision: is a rebuild worth its time?
//!
//! Algorithms 1 and 2 of SS. Pure: nothing here knows of trees, time or budgets.

use crate::error::WorldError;
use crate::tree::{Attribute, Attributes};

/// Where the least value since the last rebuild is 0, a ratio to it means nothing: then any value above this asks for
/// a rebuild. Attributes are of order 1, and rounding leaves about 1e-7 of them.
pub(crate) const ATTRIBUTE_FLOOR: f32 = 1.0e-6;

/// By what share a tree must be noisier than a new one before [`Policy::Budgeted`] asks for a rebuild. Rebuilds of the
/// same lights differ by less; without it trees that stand still would be rebuilt for ever.
pub const DEFAULT_FLOOR: f32 = 0.005;

/// What an instance wants for its tree. The variants are ordered by how demanding they are; a tree that several
/// instances share follows the most demanding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Policy {
    /// Its lights never change: an attempt to change them is refused while all instances are static.
    Static,
    /// Only ever refitted: cheap lights, or lights that move as one. The attributes are not measured.
    RefitOnly,
    /// The scheduler weighs what a rebuild buys against all others, from [`DEFAULT_FLOOR`] on.
    #[default]
    Budgeted,
    /// As [`Policy::Budgeted`], within bounds on how bad the tree may get. Both are shares of σ, the relative standard
    /// deviation of a choice within the tree, by which it is thought to exceed that of a new tree: 0.1 is ten percent.
    Bounded {
        /// Up to here no rebuild is asked for, at least 0. More saves time.
        floor: f32,
        /// From here on the tree comes before all others that are not past theirs, at least the floor.
        ceiling: f32,
    },
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
            Self::Bounded { floor, ceiling } => {
                check("floor", floor, 0.0)?;
                check("ceiling", ceiling, floor)
            }
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
pub(crate) struct AttributeHistory {
    /// Right after the last rebuild.
    pub rebuilt: Attributes,
    /// The least of each since then.
    pub least: Attributes,
}

impl AttributeHistory {
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
}

/// What a policy asks for, the more demanding the greater.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum RebuildRequest {
    /// Nothing.
    #[default]
    None,
    /// A rebuild of the tree or of parts of it, if it is worth the time.
    Optional,
    /// A rebuild of the whole tree, when there is time.
    Required,
    /// The same before all that ask for less.
    Urgent,
}

/// What a policy asks for, for a tree that was just refitted.
///
/// `history` must have observed `now` already, so that a value below the former least is its own least. `worse` is the
/// share by which the tree is thought to be noisier than a new one.
pub(crate) fn rebuild_request(
    policy: &Policy,
    history: &AttributeHistory,
    now: &Attributes,
    worse: f32,
) -> RebuildRequest {
    let if_so = |is_so: bool, request: RebuildRequest| if is_so { request } else { RebuildRequest::None };
    match *policy {
        Policy::Static | Policy::RefitOnly => RebuildRequest::None,
        Policy::AlwaysRebuild => RebuildRequest::Urgent,
        Policy::Deviation { attribute, deviation, factor } => {
            if_so(now.get(attribute) > history.least.get(attribute) + factor * deviation, RebuildRequest::Required)
        }
        Policy::Ratio { attribute, factor } => {
            let least = history.least.get(attribute);
            if_so(
                now.get(attribute) > if least > 0.0 { least * factor } else { ATTRIBUTE_FLOOR },
                RebuildRequest::Required,
            )
        }
        Policy::Budgeted => if_so(worse > DEFAULT_FLOOR, RebuildRequest::Optional),
        Policy::Bounded { ceiling, .. } if worse > ceiling => RebuildRequest::Urgent,
        Policy::Bounded { floor, .. } => if_so(worse > floor, RebuildRequest::Optional),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn overlap(value: f32) -> Attributes {
        Attributes { overlap: value, ..Attributes::default() }
    }

    fn run(policy: Policy, values: &[f32]) -> Vec<bool> {
        let mut history = AttributeHistory::start(overlap(values[0]));
        values[1..]
            .iter()
            .map(|v| {
                let now = overlap(*v);
                history.observe(&now);
                let rebuild = rebuild_request(&policy, &history, &now, 0.0) == RebuildRequest::Required;
                if rebuild {
                    history = AttributeHistory::start(now);
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
        assert!(Policy::Bounded { floor: -0.1, ceiling: 1.0 }.validate().is_err());
        assert!(Policy::Bounded { floor: 0.2, ceiling: 0.1 }.validate().is_err());
        assert!(Policy::Bounded { floor: 0.2, ceiling: f32::INFINITY }.validate().is_err());
        assert!(Policy::Bounded { floor: 0.2, ceiling: 0.2 }.validate().is_ok());
    }

    #[test]
    fn bounds_say_when_a_tree_asks_and_when_it_insists() {
        let now = Attributes::default();
        let at = |policy, worse| rebuild_request(&policy, &AttributeHistory::start(now), &now, worse);
        let bounded = Policy::Bounded { floor: 0.1, ceiling: 0.5 };
        assert_eq!(
            [0.1, 0.2, 0.5, 0.51].map(|worse| at(bounded, worse)),
            [RebuildRequest::None, RebuildRequest::Optional, RebuildRequest::Optional, RebuildRequest::Urgent]
        );
        assert_eq!(
            [0.0, DEFAULT_FLOOR, 0.03, 9.0].map(|worse| at(Policy::Budgeted, worse)),
            [RebuildRequest::None, RebuildRequest::None, RebuildRequest::Optional, RebuildRequest::Optional]
        );
        assert_eq!(at(bounded, f32::NAN), RebuildRequest::None);
    }
}

//! When a tree is rebuilt: algorithms 1 and 2 of [SS], and the two ends that they lie between.

use girandole::{Attribute, Attributes};

/// The limit of [`Rule::Ratio`] where the least value is 0, as in docs/math.md: any greater value
/// calls for a rebuild.
const FLOOR: f32 = 1.0e-6;

/// A rule that decides in each frame whether a tree is rebuilt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rule {
    /// The tree is always updated.
    Never,
    /// The tree is always rebuilt.
    Always,
    /// Algorithm 1: rebuilds above the least value plus `factor` standard deviations.
    Deviation { attribute: Attribute, deviation: f32, factor: f32 },
    /// Algorithm 2: rebuilds above `factor` times the least value.
    Ratio { attribute: Attribute, factor: f32 },
}

/// A rule and what it remembers: the least attributes since the last rebuild.
#[derive(Clone, Copy, Debug)]
pub struct Watcher {
    rule: Rule,
    least: Attributes,
}

impl Watcher {
    /// Starts with a tree that was just built.
    pub fn new(rule: Rule, built: &Attributes) -> Self {
        Self { rule, least: *built }
    }

    /// Whether an updated tree with the attributes `now` is to be rebuilt. If so, the caller passes
    /// the attributes of the rebuilt tree to [`Watcher::restart`].
    pub fn wants_rebuild(&mut self, now: &Attributes) -> bool {
        let least = &mut self.least;
        least.distance = least.distance.min(now.distance);
        least.overlap = least.overlap.min(now.overlap);
        least.variance = least.variance.min(now.variance);
        least.splitting_cost = least.splitting_cost.min(now.splitting_cost);
        match self.rule {
            Rule::Never => false,
            Rule::Always => true,
            Rule::Deviation { attribute, deviation, factor } => {
                now.get(attribute) > self.least.get(attribute) + factor * deviation
            }
            Rule::Ratio { attribute, factor } => {
                let least = self.least.get(attribute);
                now.get(attribute) > if least > 0.0 { least * factor } else { FLOOR }
            }
        }
    }

    /// Starts again with a rebuilt tree.
    pub fn restart(&mut self, rebuilt: &Attributes) {
        self.least = *rebuilt;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The decision at each value after the first; a rebuild halves the value.
    fn decisions(rule: Rule, values: &[f32]) -> Vec<bool> {
        let overlap = |overlap| Attributes { overlap, ..Attributes::default() };
        let mut watcher = Watcher::new(rule, &overlap(values[0]));
        let decide = |value: &f32| {
            let is_rebuilt = watcher.wants_rebuild(&overlap(*value));
            if is_rebuilt {
                watcher.restart(&overlap(0.5 * value));
            }
            is_rebuilt
        };
        values[1..].iter().map(decide).collect()
    }

    #[test]
    fn algorithm_1_rebuilds_above_the_least_value_plus_deviations() {
        let rule = Rule::Deviation { attribute: Attribute::Overlap, deviation: 0.1, factor: 1.1 };
        // The least value sinks from 0.5 to 0.4, then starts again at 0.26.
        let values = [0.5, 0.6, 0.4, 0.5, 0.52, 0.36, 0.38];
        assert_eq!(decisions(rule, &values), [false, false, false, true, false, true]);
    }

    #[test]
    fn algorithm_2_rebuilds_above_a_ratio_and_above_a_floor_where_the_least_value_is_0() {
        let rule = Rule::Ratio { attribute: Attribute::Overlap, factor: 1.1 };
        assert_eq!(decisions(rule, &[1.0, 1.09, 0.9, 1.0, 0.54, 0.56]), [false, false, true, false, true]);
        assert_eq!(decisions(rule, &[0.0, 0.0, 5.0e-7, 0.01]), [false, false, true]);
    }

    #[test]
    fn the_two_ends_rebuild_never_and_always() {
        assert_eq!(decisions(Rule::Never, &[1.0, 9.0, 9.0]), [false, false]);
        assert_eq!(decisions(Rule::Always, &[1.0, 1.0, 0.0]), [true, true]);
    }
}

//! Policies: when a tree requests a rebuild.
//!
//! [`Policy::Deviation`] and [`Policy::Ratio`] are algorithms 1 and 2 of SS. Everything here is a
//! function of a tree's attributes and their history; nothing here depends on trees, time or
//! budgets.

use std::collections::BTreeMap;

use crate::error::{ValueError, check_range};
use crate::tree::{Attribute, Attributes};

/// The limit of [`Policy::Ratio`] where the least value since the last rebuild is 0: any value
/// above this requests a rebuild. Attributes are of order 1, and rounding leaves about 1e-7 of
/// them.
pub(crate) const ATTRIBUTE_FLOOR: f32 = 1.0e-6;

/// The excess noise above which [`Policy::Budgeted`] requests a rebuild, measured as in
/// [`Policy::Bounded`]. Rebuilds of the same lights differ by less. Without this floor, trees at
/// rest would be rebuilt for ever.
pub const DEFAULT_FLOOR: f32 = 0.005;

/// When an instance requests a rebuild of its tree. A tree that several instances share makes the
/// most demanding request of all their policies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Policy {
    /// The lights never change: while all instances of a tree are static, edits of its lights are
    /// refused with [`WorldError::StaticTree`](crate::WorldError::StaticTree).
    Static,
    /// The tree is refitted and never rebuilt, for cheap lights or lights that move as one. Its
    /// attributes are not measured.
    RefitOnly,
    /// The scheduler weighs a rebuild against those of all other trees, once the tree is noisier
    /// than a new tree by more than [`DEFAULT_FLOOR`].
    #[default]
    Budgeted,
    /// As [`Policy::Budgeted`], with bounds on the excess noise. The excess is the estimated share
    /// by which σ, the relative standard deviation of a choice within the tree, exceeds that of a
    /// new tree: 0.1 is ten percent.
    Bounded {
        /// Up to this excess no rebuild is requested. At least 0; a higher floor saves time.
        floor: f32,
        /// Above this excess the request is urgent: the tree is rebuilt before all trees that ask
        /// at the same time or later and are not urgent. At least `floor`.
        ceiling: f32,
    },
    /// Algorithm 1 of SS: requests a rebuild when the attribute exceeds its least value since the
    /// last rebuild by `factor` standard deviations.
    Deviation {
        /// The attribute that is watched.
        attribute: Attribute,
        /// Its standard deviation over rebuilt trees, at least 0.
        deviation: f32,
        /// The factor S of SS, at least 0.
        factor: f32,
    },
    /// Algorithm 2 of SS: requests a rebuild when the attribute exceeds `factor` times its least
    /// value since the last rebuild.
    Ratio {
        /// The attribute that is watched.
        attribute: Attribute,
        /// The factor S of SS, at least 1; 1.1 is ten percent.
        factor: f32,
    },
    /// The tree requests a rebuild whenever its lights change. The request is urgent, as above the
    /// ceiling of [`Policy::Bounded`].
    AlwaysRebuild,
}

impl Policy {
    /// Checks that thresholds are finite numbers within their stated ranges.
    pub(crate) fn validate(&self) -> Result<(), ValueError> {
        let check = |what, value, min| check_range(what, value, min, f32::MAX);
        match *self {
            Self::Deviation { deviation, factor, .. } => {
                check("the deviation of the policy", deviation, 0.0)?;
                check("the factor of the policy", factor, 0.0)
            }
            Self::Ratio { factor, .. } => check("the factor of the policy", factor, 1.0),
            Self::Bounded { floor, ceiling } => {
                check("the floor of the policy", floor, 0.0)?;
                check("the ceiling of the policy", ceiling, floor)
            }
            _ => Ok(()),
        }
    }

    /// Whether the policy can ever request a rebuild.
    pub(crate) fn may_rebuild(&self) -> bool {
        !matches!(self, Self::Static | Self::RefitOnly)
    }
}

/// A tree's attributes since its last rebuild.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct AttributeHistory {
    /// The attributes right after the last rebuild.
    pub rebuilt: Attributes,
    /// The least value of each attribute since then.
    pub least: Attributes,
}

impl AttributeHistory {
    /// Starts with the attributes of a tree that was just built.
    pub fn start(rebuilt: Attributes) -> Self {
        Self { rebuilt, least: rebuilt }
    }

    /// Records the attributes after a refit.
    pub fn observe(&mut self, now: &Attributes) {
        let least = &mut self.least;
        least.distance = least.distance.min(now.distance);
        least.overlap = least.overlap.min(now.overlap);
        least.variance = least.variance.min(now.variance);
        least.splitting_cost = least.splitting_cost.min(now.splitting_cost);
    }
}

/// How much noisier a tree is than a new tree over the same lights: the share by which σ, the
/// relative standard deviation of a choice within the tree, is greater.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Excess {
    /// The prediction.
    pub likely: f32,
    /// What the prediction cannot exclude; 0 for a tree that has not changed since it was built.
    pub possible: f32,
}

/// What a policy requests. A greater request is more demanding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum RebuildRequest {
    /// No rebuild.
    #[default]
    None,
    /// A rebuild that will probably gain nothing, once much time was granted since the tree
    /// changed. Without it, a tree whose noise is predicted wrongly would never be rebuilt.
    Doubtful,
    /// A rebuild, if it is worth its time.
    Optional,
    /// A rebuild, even if the tree is no longer noisy when there is time for it.
    Required,
    /// A rebuild before trees with lesser requests that ask at the same time or later.
    Urgent,
}

/// Returns the request of a policy for a tree that was just refitted to the attributes `now`.
///
/// `history` must have observed `now` already, so that a value below the former least value is its
/// own least value. `excess` is that of the tree now.
pub(crate) fn rebuild_request(
    policy: &Policy,
    history: &AttributeHistory,
    now: &Attributes,
    excess: Excess,
) -> RebuildRequest {
    let above = |floor: f32| {
        if excess.likely > floor {
            RebuildRequest::Optional
        } else if excess.possible > floor {
            RebuildRequest::Doubtful
        } else {
            RebuildRequest::None
        }
    };
    let request_if = |condition: bool, request| if condition { request } else { RebuildRequest::None };
    match *policy {
        Policy::Static | Policy::RefitOnly => RebuildRequest::None,
        Policy::AlwaysRebuild => RebuildRequest::Urgent,
        Policy::Deviation { attribute, deviation, factor } => {
            let limit = history.least.get(attribute) + factor * deviation;
            request_if(now.get(attribute) > limit, RebuildRequest::Required)
        }
        Policy::Ratio { attribute, factor } => {
            let least = history.least.get(attribute);
            let limit = if least > 0.0 { least * factor } else { ATTRIBUTE_FLOOR };
            request_if(now.get(attribute) > limit, RebuildRequest::Required)
        }
        Policy::Budgeted => above(DEFAULT_FLOOR),
        Policy::Bounded { ceiling, .. } if excess.likely > ceiling => RebuildRequest::Urgent,
        Policy::Bounded { floor, .. } => above(floor),
    }
}

/// The policies of all instances of a tree.
///
/// The most demanding of their requests depends on the least threshold of each criterion alone, so
/// the thresholds are kept in order. A change of one policy is O(log n) and a request O(log n),
/// where n is the number of distinct thresholds; a list of distinct policies took 4.2 s for 40,000
/// of them.
#[derive(Clone, Debug, Default)]
pub(crate) struct PolicySet {
    len: u32,
    static_count: u32,
    refit_only_count: u32,
    /// Most trees have this policy alone, and a map of its thresholds takes 200 bytes.
    budgeted_count: u32,
    always_rebuild_count: u32,
    /// The thresholds of all other policies, with the number of policies that have them.
    thresholds: BTreeMap<Threshold, usize>,
}

/// A criterion of some policies and the bits of its threshold. Thresholds are not negative, so
/// their bits order as their values do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Threshold {
    criterion: Criterion,
    bits: u32,
}

/// What a threshold is compared with: in each case less demanding policies have greater thresholds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Criterion {
    /// The floor of [`Policy::Bounded`].
    Floor,
    /// The ceiling of [`Policy::Bounded`].
    Ceiling,
    /// `deviation * factor` of [`Policy::Deviation`], by the number of its attribute.
    Deviation(u8),
    /// `factor` of [`Policy::Ratio`], by the number of its attribute.
    Ratio(u8),
}

const ATTRIBUTES: [Attribute; 4] =
    [Attribute::Distance, Attribute::Overlap, Attribute::Variance, Attribute::SplittingCost];

impl Threshold {
    fn new(criterion: Criterion, value: f32) -> Self {
        // The sum makes -0 a 0, whose bits are the least.
        Self { criterion, bits: (value + 0.0).to_bits() }
    }

    fn value(&self) -> f32 {
        f32::from_bits(self.bits)
    }
}

impl PolicySet {
    /// Adds the policy of one instance.
    pub fn insert(&mut self, policy: Policy) {
        self.len += 1;
        match policy {
            Policy::Static => self.static_count += 1,
            Policy::RefitOnly => self.refit_only_count += 1,
            Policy::Budgeted => self.budgeted_count += 1,
            Policy::AlwaysRebuild => self.always_rebuild_count += 1,
            _ => thresholds_of(&policy).for_each(|threshold| *self.thresholds.entry(threshold).or_default() += 1),
        }
    }

    /// Removes the policy of one instance, which was added before.
    pub fn remove(&mut self, policy: Policy) {
        self.len -= 1;
        match policy {
            Policy::Static => self.static_count -= 1,
            Policy::RefitOnly => self.refit_only_count -= 1,
            Policy::Budgeted => self.budgeted_count -= 1,
            Policy::AlwaysRebuild => self.always_rebuild_count -= 1,
            _ => thresholds_of(&policy).for_each(|threshold| self.remove_threshold(threshold)),
        }
    }

    fn remove_threshold(&mut self, threshold: Threshold) {
        let Some(count) = self.thresholds.get_mut(&threshold) else { return };
        *count -= 1;
        if *count == 0 {
            self.thresholds.remove(&threshold);
        }
    }

    /// Whether some policy can ever request a rebuild.
    pub fn may_rebuild(&self) -> bool {
        self.len > self.static_count + self.refit_only_count
    }

    /// Whether there are policies and all of them are [`Policy::Static`].
    pub fn is_static(&self) -> bool {
        self.len > 0 && self.static_count == self.len
    }

    /// Returns the greatest [`rebuild_request`] of all policies.
    pub fn rebuild_request(&self, history: &AttributeHistory, now: &Attributes, excess: Excess) -> RebuildRequest {
        let requests = self.most_demanding().map(|policy| rebuild_request(&policy, history, now, excess));
        requests.max().unwrap_or_default()
    }

    /// At most eleven policies whose most demanding request is that of all policies.
    fn most_demanding(&self) -> impl Iterator<Item = Policy> {
        let always = (self.always_rebuild_count > 0).then_some(Policy::AlwaysRebuild);
        let budgeted = (self.budgeted_count > 0).then_some(Policy::Budgeted);
        // Each floor is at most its own ceiling, and so the least floor at most the least ceiling.
        let bounded = self.least(Criterion::Floor).zip(self.least(Criterion::Ceiling));
        let bounded = bounded.map(|(floor, ceiling)| Policy::Bounded { floor, ceiling });
        let by_attribute = ATTRIBUTES.into_iter().flat_map(|attribute| {
            let deviation = self.least(Criterion::Deviation(attribute as u8));
            let factor = self.least(Criterion::Ratio(attribute as u8));
            [
                deviation.map(|deviation| Policy::Deviation { attribute, deviation, factor: 1.0 }),
                factor.map(|factor| Policy::Ratio { attribute, factor }),
            ]
        });
        [always, budgeted, bounded].into_iter().chain(by_attribute).flatten()
    }

    /// The least threshold of a criterion.
    fn least(&self, criterion: Criterion) -> Option<f32> {
        let (threshold, _) = self.thresholds.range(Threshold { criterion, bits: 0 }..).next()?;
        (threshold.criterion == criterion).then(|| threshold.value())
    }
}

/// The thresholds of a policy that has some: one, or a floor and a ceiling.
fn thresholds_of(policy: &Policy) -> impl Iterator<Item = Threshold> + use<> {
    let thresholds = match *policy {
        Policy::Static | Policy::RefitOnly | Policy::Budgeted | Policy::AlwaysRebuild => [None, None],
        Policy::Bounded { floor, ceiling } => bounds(floor, ceiling),
        Policy::Deviation { attribute, deviation, factor } => {
            [Some(Threshold::new(Criterion::Deviation(attribute as u8), factor * deviation)), None]
        }
        Policy::Ratio { attribute, factor } => [Some(Threshold::new(Criterion::Ratio(attribute as u8), factor)), None],
    };
    thresholds.into_iter().flatten()
}

fn bounds(floor: f32, ceiling: f32) -> [Option<Threshold>; 2] {
    [Some(Threshold::new(Criterion::Floor, floor)), Some(Threshold::new(Criterion::Ceiling, ceiling))]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn overlap(value: f32) -> Attributes {
        Attributes { overlap: value, ..Attributes::default() }
    }

    /// Whether the policy requests a rebuild at each value after the first; each request is
    /// granted.
    fn run(policy: Policy, values: &[f32]) -> Vec<bool> {
        let mut history = AttributeHistory::start(overlap(values[0]));
        values[1..]
            .iter()
            .map(|v| {
                let now = overlap(*v);
                history.observe(&now);
                let rebuild = rebuild_request(&policy, &history, &now, Excess::default()) == RebuildRequest::Required;
                if rebuild {
                    history = AttributeHistory::start(now);
                }
                rebuild
            })
            .collect()
    }

    #[test]
    fn algorithm_1_asks_above_the_least_value_plus_deviations() {
        let policy = Policy::Deviation { attribute: Attribute::Overlap, deviation: 0.1, factor: 1.0 };
        // The least value sinks to 0.4, so 0.49 stays within one deviation of 0.1 and 0.51 does
        // not.
        assert_eq!(run(policy, &[0.5, 0.59, 0.4, 0.49, 0.51, 0.6]), [false, false, false, true, false]);
    }

    #[test]
    fn algorithm_2_asks_above_a_ratio_and_above_a_floor_where_the_least_value_is_zero() {
        let policy = Policy::Ratio { attribute: Attribute::Overlap, factor: 1.1 };
        assert_eq!(run(policy, &[1.0, 1.09, 1.11, 1.2, 1.23]), [false, true, false, true]);
        assert_eq!(run(policy, &[0.0, 0.0, 1e-7, 0.01, 0.011]), [false, false, true, false]);
    }

    #[test]
    fn thresholds_out_of_range_are_refused() {
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
    fn a_bounded_tree_asks_above_its_floor_and_urgently_above_its_ceiling() {
        let now = Attributes::default();
        let likely = |likely| Excess { likely, possible: likely };
        let at = |policy, excess| rebuild_request(&policy, &AttributeHistory::start(now), &now, likely(excess));
        let bounded = Policy::Bounded { floor: 0.1, ceiling: 0.5 };
        assert_eq!(
            [0.1, 0.2, 0.5, 0.51].map(|excess| at(bounded, excess)),
            [RebuildRequest::None, RebuildRequest::Optional, RebuildRequest::Optional, RebuildRequest::Urgent]
        );
        assert_eq!(
            [0.0, DEFAULT_FLOOR, 0.03, 9.0].map(|excess| at(Policy::Budgeted, excess)),
            [RebuildRequest::None, RebuildRequest::None, RebuildRequest::Optional, RebuildRequest::Optional]
        );
        assert_eq!(at(bounded, f32::NAN), RebuildRequest::None);
        let doubted = Excess { likely: 0.0, possible: 0.4 };
        let requests = [Policy::Budgeted, bounded, Policy::Bounded { floor: 0.5, ceiling: 0.5 }]
            .map(|policy| rebuild_request(&policy, &AttributeHistory::start(now), &now, doubted));
        assert_eq!(requests, [RebuildRequest::Doubtful, RebuildRequest::Doubtful, RebuildRequest::None]);
    }

    /// A number below `limit` that depends on `seed` alone.
    fn random(seed: u64, limit: u64) -> u64 {
        let mix = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mix = (mix ^ (mix >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (mix >> 33) % limit
    }

    fn random_policy(seed: u64) -> Policy {
        let share = |salt: u64| random(8 * seed + salt, 40) as f32 * 0.01;
        let attribute = ATTRIBUTES[random(8 * seed + 3, 4) as usize];
        match random(8 * seed + 4, 9) {
            0 => Policy::Static,
            1 => Policy::RefitOnly,
            2 => Policy::Budgeted,
            3 if random(8 * seed + 5, 4) == 0 => Policy::AlwaysRebuild,
            4 | 5 => Policy::Deviation { attribute, deviation: share(0), factor: share(1) },
            6 => Policy::Deviation { attribute, deviation: -0.0, factor: share(1) },
            7 => Policy::Ratio { attribute, factor: 1.0 + share(0) },
            _ => Policy::Bounded { floor: share(0), ceiling: share(0) + share(1) },
        }
    }

    #[test]
    fn a_set_of_policies_asks_for_what_the_most_demanding_of_them_asks_for() {
        let mut requests = [0; 5];
        for seed in 0..4000 {
            let (mut set, mut list) = (PolicySet::default(), Vec::new());
            for step in 0..1 + random(seed, 12) {
                if random(97 * seed + step, 3) == 0 && !list.is_empty() {
                    set.remove(list.swap_remove(random(31 * seed + step, list.len() as u64) as usize));
                } else {
                    let policy = random_policy(50 * seed + step);
                    policy.validate().expect("in range");
                    list.push(policy);
                    set.insert(policy);
                }
            }
            let value = |salt: u64| random(11 * seed + salt, 60) as f32 * 0.01;
            let attributes = |salt| Attributes {
                distance: value(salt),
                overlap: value(salt + 1),
                variance: value(salt + 2),
                splitting_cost: value(salt + 3),
            };
            let mut history = AttributeHistory::start(attributes(0));
            let (now, excess) = (attributes(4), Excess { likely: value(8), possible: value(8) + value(9) });
            history.observe(&now);
            let expected = list.iter().map(|policy| rebuild_request(policy, &history, &now, excess)).max();
            let request = set.rebuild_request(&history, &now, excess);
            assert_eq!(request, expected.unwrap_or_default(), "{list:?}");
            assert_eq!(set.may_rebuild(), list.iter().any(Policy::may_rebuild), "{list:?}");
            assert_eq!(set.is_static(), !list.is_empty() && list.iter().all(|p| *p == Policy::Static), "{list:?}");
            requests[request as usize] += 1;
            list.into_iter().for_each(|policy| set.remove(policy));
            assert!(set.thresholds.is_empty() && set.len == 0);
        }
        assert!(requests.iter().all(|count| *count > 100), "each request is tested often: {requests:?}");
    }

    #[test]
    fn a_request_looks_at_ten_policies_however_many_distinct_ones_there_are() {
        let mut set = PolicySet::default();
        for i in 0..40_000_u32 {
            let (attribute, share) = (ATTRIBUTES[i as usize % 4], i as f32 * 1.0e-3);
            set.insert(Policy::Bounded { floor: share, ceiling: 2.0 * share });
            set.insert(Policy::Deviation { attribute, deviation: share, factor: 2.0 });
            set.insert(Policy::Ratio { attribute, factor: 1.0 + share });
            set.insert(Policy::AlwaysRebuild);
        }
        assert_eq!(set.thresholds.len(), 4 * 40_000);
        assert_eq!(set.most_demanding().count(), 10);
    }
}

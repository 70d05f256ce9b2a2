//! The record of an instance: its policy, its appearance and its placement.

use glam::Mat3;

use super::words::{of_point, of_vector, to_point, to_vector};
use crate::error::WorldError;
use crate::instance::appearance::{Appearance, check_factor};
use crate::instance::placement::Placement;
use crate::policy::Policy;
use crate::tree::Attribute;

/// Numbers of a record.
pub(super) const WORDS: usize = 4 + 6 + 9 + 6;

const ATTRIBUTES: [Attribute; 4] =
    [Attribute::Distance, Attribute::Overlap, Attribute::Variance, Attribute::SplittingCost];

/// The kind of a policy, the number of its attribute and its thresholds.
fn of_policy(policy: Policy) -> [u32; 4] {
    match policy {
        Policy::Static => [0; 4],
        Policy::RefitOnly => [1, 0, 0, 0],
        Policy::Budgeted => [2, 0, 0, 0],
        Policy::AlwaysRebuild => [3, 0, 0, 0],
        Policy::Bounded { floor, ceiling } => [4, 0, floor.to_bits(), ceiling.to_bits()],
        Policy::Deviation { attribute, deviation, factor } => {
            [5, attribute as u32, deviation.to_bits(), factor.to_bits()]
        }
        Policy::Ratio { attribute, factor } => [6, attribute as u32, factor.to_bits(), 0],
    }
}

/// The policy of such numbers; `None` if no policy has them.
fn to_policy(words: [u32; 4]) -> Option<Policy> {
    let [kind, attribute, a, b] = words;
    let attribute = *ATTRIBUTES.get(attribute as usize)?;
    let [a, b] = [a, b].map(f32::from_bits);
    let policy = match kind {
        0 => Policy::Static,
        1 => Policy::RefitOnly,
        2 => Policy::Budgeted,
        3 => Policy::AlwaysRebuild,
        4 => Policy::Bounded { floor: a, ceiling: b },
        5 => Policy::Deviation { attribute, deviation: a, factor: b },
        6 => Policy::Ratio { attribute, factor: a },
        _ => return None,
    };
    (of_policy(policy) == words).then_some(policy)
}

/// The numbers of an instance.
pub(super) fn encode(placement: &Placement, policy: Policy, appearance: &Appearance) -> [u32; WORDS] {
    let [r, g, b] = of_vector(appearance.factor);
    let parts = [
        &of_policy(policy)[..],
        &[u32::from(appearance.is_enabled), r, g, b, appearance.mask, appearance.user_data],
        &placement.linear.to_cols_array().map(f32::to_bits),
        &of_point(placement.translation),
    ];
    let mut words = [0; WORDS];
    words.iter_mut().zip(parts.into_iter().flatten()).for_each(|(word, part)| *word = *part);
    words
}

/// The instance of some numbers; `None` if none has them.
///
/// # Errors
/// [`WorldError`] for a policy or a factor that a world refuses. Placements are not checked.
pub(super) fn decode(words: &[u32; WORDS]) -> Option<Result<(Placement, Policy, Appearance), WorldError>> {
    let at = |first: usize| [words[first], words[first + 1], words[first + 2]];
    let policy = to_policy([words[0], words[1], words[2], words[3]])?;
    let is_enabled = [false, true].get(words[4] as usize)?;
    let factor = to_vector(at(5));
    let linear = Mat3::from_cols(to_vector(at(10)), to_vector(at(13)), to_vector(at(16)));
    let [x, y] = [at(19), at(22)];
    let placement = Placement { linear, translation: to_point([x[0], x[1], x[2], y[0], y[1], y[2]]) };
    let checked = policy.validate().and_then(|()| check_factor(factor));
    let appearance = Appearance { is_enabled: *is_enabled, factor, mask: words[8], user_data: words[9] };
    Some(checked.map(|()| (placement, policy, appearance)))
}

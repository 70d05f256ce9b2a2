//! Counts of effects, which every edit keeps up to date, and the effects that are held for some
//! updates after their counts have fallen to 0.

use super::Effects;
use crate::rare::HasEmpty;

/// How many calls of [`LightWorld::update`](crate::LightWorld::update) an effect stays in
/// [`LightWorld::effects`](crate::LightWorld::effects) after nothing in the world has it any more.
/// A tree also counts as [moving](Effects::MOVING) for this long after its last change.
///
/// 120 updates are two seconds at 60 frames a second. A smaller value would follow a lasting
/// change sooner; a larger one would tolerate slower flicker without another set of effects, and so
/// without another pipeline.
pub const EFFECT_HOLD_UPDATES: u32 = 120;

const KINDS: usize = Effects::NAMES.len();

/// For each effect, the number of lights, instances and trees that have it.
///
/// A world and a tree keep their own counts
/// ([`LightWorld::effect_counts`](crate::LightWorld::effect_counts),
/// [`LightTree::effects`](crate::LightTree::effects)); callers can only read them.
///
/// ```
/// use girandole::{Effects, Light, LightTree, glam::Vec3};
/// let lamp = Light::point(Vec3::ZERO, Vec3::ONE);
/// let tree = LightTree::new(vec![lamp, lamp.with_range(9.0)])?;
/// assert_eq!((tree.effects().of(Effects::RANGES), tree.effects().effects()), (1, Effects::RANGES));
/// # Ok::<(), girandole::WorldError>(())
/// ```
///
/// ```compile_fail,E0624
/// // Private: removing what was never added would underflow.
/// girandole::EffectCounts::default().remove(girandole::Effects::RANGES);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EffectCounts {
    /// Indexed by the number of the effect.
    counts: [u64; KINDS],
}

impl HasEmpty for EffectCounts {
    const EMPTY: &'static Self = &Self { counts: [0; KINDS] };

    fn owned_bytes(&self) -> usize {
        0
    }
}

impl EffectCounts {
    /// The counts of one light, instance or tree.
    pub(crate) fn one(effects: Effects) -> Self {
        let mut counts = Self::default();
        counts.add(effects);
        counts
    }

    /// Adds one light, instance or tree with these effects.
    pub(crate) fn add(&mut self, effects: Effects) {
        effects.numbers().for_each(|kind| self.counts[kind] += 1);
    }

    /// Adds several lights that all have these effects.
    pub(crate) fn add_several(&mut self, effects: Effects, count: u64) {
        effects.numbers().for_each(|kind| self.counts[kind] += count);
    }

    /// Removes one light, instance or tree with these effects, which must have been added.
    pub(crate) fn remove(&mut self, effects: Effects) {
        effects.numbers().for_each(|kind| self.counts[kind] -= 1);
    }

    /// Adds all counts of another.
    pub(crate) fn add_all(&mut self, other: &Self) {
        self.counts.iter_mut().zip(other.counts).for_each(|(count, more)| *count += more);
    }

    /// Subtracts all counts of another, which must have been added.
    pub(crate) fn remove_all(&mut self, other: &Self) {
        self.counts.iter_mut().zip(other.counts).for_each(|(count, less)| *count -= less);
    }

    /// The number of lights, instances and trees that have an effect; for a set of several
    /// effects, the sum of their counts.
    pub fn of(&self, effects: Effects) -> u64 {
        effects.numbers().map(|kind| self.counts[kind]).sum()
    }

    /// Whether something has an effect, a single one. O(1).
    pub(crate) fn has(&self, effect: Effects) -> bool {
        effect.numbers().any(|number| self.counts[number] > 0)
    }

    /// The effects with a count above 0.
    pub fn effects(&self) -> Effects {
        (0..KINDS).filter(|kind| self.counts[*kind] > 0).map(Effects::of_number).collect()
    }
}

/// The counts of a world, and the effects that it still holds after their counts fell to 0.
#[derive(Clone, Debug, Default)]
pub(crate) struct HeldEffects {
    counts: EffectCounts,
    /// For each effect, the number of updates for which it is still held.
    updates_left: [u32; KINDS],
}

impl HeldEffects {
    /// The counts as of now.
    pub fn counts(&self) -> &EffectCounts {
        &self.counts
    }

    /// The effects with a count above 0 now or within the last [`EFFECT_HOLD_UPDATES`] updates,
    /// without [`Effects::MOVING`]: sets that differ only in it have the same shaders.
    pub fn effects(&self) -> Effects {
        let is_held = |kind: &usize| self.updates_left[*kind] > 0;
        let held = (0..KINDS).filter(is_held).map(Effects::of_number);
        held.fold(self.counts.effects(), |all, one| all | one) - Effects::MOVING
    }

    /// Counts other things in place of some. An effect whose count falls to 0 is held from now on.
    pub fn replace(&mut self, former: &EffectCounts, present: &EffectCounts) {
        if former == present {
            return;
        }
        let before = self.counts.effects();
        self.counts.add_all(present);
        self.counts.remove_all(former);
        let gone = before - self.counts.effects();
        gone.numbers().for_each(|kind| self.updates_left[kind] = EFFECT_HOLD_UPDATES);
    }

    /// Sets the count of an effect.
    pub fn set(&mut self, effect: Effects, count: usize) {
        let [mut former, mut present] = [EffectCounts::default(); 2];
        former.add_several(effect, self.counts.of(effect));
        present.add_several(effect, count as u64);
        self.replace(&former, &present);
    }

    /// Counts one update.
    pub fn count_update(&mut self) {
        self.updates_left.iter_mut().for_each(|left| *left = left.saturating_sub(1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_is_there_at_once_and_is_held_after_it_is_gone() {
        let mut held = HeldEffects::default();
        held.replace(&EffectCounts::default(), &EffectCounts::one(Effects::RANGES | Effects::MOVING));
        assert_eq!(held.counts().effects(), Effects::RANGES | Effects::MOVING);
        assert_eq!(held.effects(), Effects::RANGES);
        held.replace(&EffectCounts::one(Effects::RANGES | Effects::MOVING), &EffectCounts::default());
        assert_eq!(held.counts().effects(), Effects::empty());
        for _ in 0..EFFECT_HOLD_UPDATES {
            assert_eq!(held.effects(), Effects::RANGES);
            held.count_update();
        }
        assert_eq!(held.effects(), Effects::empty());
    }
}

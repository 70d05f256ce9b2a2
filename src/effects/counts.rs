//! How much there is of each effect: kept up by every edit, so that nobody ever looks through all lights.

use super::Effects;

/// How many calls of [`LightWorld::update`](crate::LightWorld::update) an effect stays in
/// [`LightWorld::effects`](crate::LightWorld::effects) after the last thing that called for it is gone, and a tree counts as
/// moving after its last change: two seconds at 60 frames a second. Fewer answer sooner to what has really ended; more
/// bear slower flicker without another set, and so without another shader.
pub const EFFECT_HOLD_UPDATES: u32 = 120;

const KINDS: usize = Effects::all().bits().count_ones() as usize;

/// For each effect, how many lights, instances and trees call for it.
///
/// ```
/// use girandole::{EffectCounts, Effects, Light, glam::Vec3};
/// let mut counts = EffectCounts::default();
/// let lamp = Light::point(Vec3::ZERO, Vec3::ONE).with_range(9.0);
/// counts.add(lamp.effects());
/// assert_eq!((counts.of(Effects::RANGES), counts.effects()), (1, Effects::RANGES));
/// counts.remove(lamp.effects());
/// assert_eq!(counts, EffectCounts::default());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EffectCounts {
    /// By the place of the effect's bit.
    counts: [u64; KINDS],
}

impl EffectCounts {
    /// One more thing with these effects.
    pub fn add(&mut self, effects: Effects) {
        each(effects).for_each(|kind| self.counts[kind] += 1);
    }

    /// One thing with these effects less: one that was added.
    pub fn remove(&mut self, effects: Effects) {
        each(effects).for_each(|kind| self.counts[kind] -= 1);
    }

    /// All that another holds.
    pub fn add_all(&mut self, other: &Self) {
        self.counts.iter_mut().zip(other.counts).for_each(|(count, more)| *count += more);
    }

    /// All that another holds, less: it was added.
    pub fn remove_all(&mut self, other: &Self) {
        self.counts.iter_mut().zip(other.counts).for_each(|(count, less)| *count -= less);
    }

    /// How many things have these effects: of several effects, the sum.
    pub fn of(&self, effects: Effects) -> u64 {
        each(effects).map(|kind| self.counts[kind]).sum()
    }

    /// The effects that something has.
    pub fn effects(&self) -> Effects {
        let is_there = |kind: &usize| self.counts[*kind] > 0;
        (0..KINDS).filter(is_there).fold(Effects::empty(), |all, kind| all | Effects::from_bits_retain(1 << kind))
    }
}

/// The places of the bits that are set.
fn each(effects: Effects) -> impl Iterator<Item = usize> {
    (0..KINDS).filter(move |kind| effects.bits() >> kind & 1 != 0)
}

/// Counts, and which effects went so short a time ago that they may be back soon.
#[derive(Clone, Debug, Default)]
pub(crate) struct Damped {
    counts: EffectCounts,
    /// For each effect, the updates it still stays for.
    left: [u32; KINDS],
}

impl Damped {
    /// As things are now.
    pub fn counts(&self) -> &EffectCounts {
        &self.counts
    }

    /// What is called for, and what was within the last [`EFFECT_HOLD_UPDATES`] updates.
    pub fn effects(&self) -> Effects {
        let is_kept = |kind: &usize| self.left[*kind] > 0;
        let kept = (0..KINDS).filter(is_kept).map(|kind| Effects::from_bits_retain(1 << kind));
        kept.fold(self.counts.effects(), |all, one| all | one)
    }

    /// Changes the counts; what nothing calls for afterwards starts to fade.
    pub fn change(&mut self, change: impl FnOnce(&mut EffectCounts)) {
        let before = self.counts.effects();
        change(&mut self.counts);
        // What moves is counted for that long after the last change anyway.
        let gone = before - self.counts.effects() - Effects::MOVING;
        each(gone).for_each(|kind| self.left[kind] = EFFECT_HOLD_UPDATES);
    }

    /// An update has passed.
    pub fn fade(&mut self) {
        self.left.iter_mut().for_each(|left| *left = left.saturating_sub(1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_comes_at_once_and_goes_late() {
        let mut damped = Damped::default();
        damped.change(|counts| counts.add(Effects::RANGES | Effects::MOVING));
        assert_eq!(damped.effects(), Effects::RANGES | Effects::MOVING);
        damped.change(|counts| counts.remove(Effects::RANGES | Effects::MOVING));
        assert_eq!(damped.counts().effects(), Effects::empty());
        for _ in 0..EFFECT_HOLD_UPDATES {
            assert_eq!(damped.effects(), Effects::RANGES);
            damped.fade();
        }
        assert_eq!(damped.effects(), Effects::empty());
    }
}

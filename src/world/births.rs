//! Which light a slot and an index mean: the numbers of the edits that brought the instance and the light.

use crate::keys::{DirectionalKey, slot_of};
use crate::math::dice::hash;
use crate::rare::HasEmpty;

/// Bits of a birth number, which starts again from 1 after 2²³ - 1 edits.
pub(crate) const BIRTH_BITS: u32 = 23;

/// Gives birth numbers, one for each edit that brings lights or an instance.
#[derive(Debug, Default)]
pub(super) struct BirthCounter(u32);

impl BirthCounter {
    pub fn next(&mut self) -> u32 {
        self.0 = self.0 % ((1 << BIRTH_BITS) - 1) + 1;
        self.0
    }
}

/// The birth numbers of a tree's lights: 0 for those that came with the tree.
#[derive(Clone, Debug, Default)]
pub(crate) struct Births(Vec<u32>);

impl Births {
    /// Notes that lights were added to the tree, which now has `count` indices. O(added), but for the first
    /// call.
    pub fn add(&mut self, added: &[u32], count: usize, birth: u32) {
        self.0.resize(count, 0);
        added.iter().for_each(|light| self.0[*light as usize] = birth);
    }

    pub fn of(&self, light: u32) -> u32 {
        self.0.get(light as usize).copied().unwrap_or(0)
    }
}

impl HasEmpty for Births {
    const EMPTY: &'static Self = &Self(Vec::new());

    fn owned_bytes(&self) -> usize {
        self.0.owned_bytes()
    }
}

/// The number of the last edit that changed which lights an instance has, of the one that added it and the
/// last one that replaced its tree.
pub(crate) fn of_instance(birth: u32, replaced: u32) -> u32 {
    birth.max(replaced)
}

/// The birth number of a directional light.
pub(crate) fn birth_of_directional(key: DirectionalKey) -> u32 {
    let version = (u64::from(key) >> 32) as u32;
    hash(slot_of(key) ^ hash(version)) >> (u32::BITS - BIRTH_BITS)
}

/// A number for a light, at least 1 and below 2²⁴. Twin of `light_generation` in `shaders/records.wgsl`.
pub(super) fn generation(of_instance: u32, of_light: u32) -> u32 {
    (hash(of_instance ^ hash(of_light)) >> 8).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn added_lights_have_the_number_of_their_edit_and_others_keep_theirs() {
        let mut births = Births::default();
        assert_eq!((births.of(0), births.of(1_000_000), births.owned_bytes()), (0, 0, 0));
        births.add(&[2, 4], 5, 6);
        births.add(&[2], 5, 7);
        assert_eq!([0, 1, 2, 3, 4, 5].map(|light| births.of(light)), [0, 0, 7, 0, 6, 0]);
    }

    #[test]
    fn numbers_start_again_after_the_last_one_and_are_never_0() {
        let last = (1 << BIRTH_BITS) - 1;
        let mut counter = BirthCounter(last - 1);
        assert_eq!([(); 3].map(|()| counter.next()), [last, 1, 2]);
        assert!((1..1 << 24).contains(&generation(0, 0)));
        assert_ne!(generation(1, 0), generation(0, 1));
    }
}

//! When each slot changed last.

use super::slot_set::{BITS, bits_of};

/// The number of the last change of each slot, 0 before the first one.
///
/// Above them lie the latest of each 64 slots and of each 4096, so that few changes among many slots
/// are found without a look at all of them. Takes 8 bytes for each slot up to the greatest one that
/// ever changed.
#[derive(Debug, Default)]
pub(super) struct Stamps {
    slots: Vec<u64>,
    words: Vec<u64>,
    groups: Vec<u64>,
}

impl Stamps {
    /// The number of the last change of a slot.
    pub fn get(&self, slot: u32) -> u64 {
        self.slots.get(slot as usize).copied().unwrap_or(0)
    }

    /// Records a change. Numbers must not fall. O(1).
    pub fn set(&mut self, slot: u32, number: u64) {
        let slot = slot as usize;
        let word = slot / BITS;
        if self.words.len() <= word {
            self.slots.resize((word + 1) * BITS, 0);
            self.words.resize(word + 1, 0);
            self.groups.resize(word / BITS + 1, 0);
        }
        self.slots[slot] = number;
        self.words[word] = number;
        self.groups[word / BITS] = number;
    }

    /// Which of 64 slots changed after a number, as bits.
    fn word_after(&self, word: usize, number: u64) -> u64 {
        if self.words.get(word).is_none_or(|latest| *latest <= number) {
            return 0;
        }
        let slots = self.slots[word * BITS..].iter().take(BITS);
        slots.rev().fold(0, |bits, last| bits << 1 | u64::from(*last > number))
    }

    /// The size in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of::<u64>() * (self.slots.capacity() + self.words.capacity() + self.groups.capacity())
    }
}

/// The words of slots of which any of `kinds` changed after a number, with their indices.
fn words_after<const N: usize>(kinds: [&Stamps; N], number: u64) -> impl Iterator<Item = (usize, u64)> {
    let groups = kinds.iter().map(|stamps| stamps.groups.len()).max().unwrap_or(0);
    let is_later = move |group: &usize| {
        kinds.iter().any(|stamps| stamps.groups.get(*group).is_some_and(|latest| *latest > number))
    };
    let words = (0..groups).filter(is_later).flat_map(|group| group * BITS..(group + 1) * BITS);
    words
        .map(move |word| (word, kinds.iter().fold(0, |bits, stamps| bits | stamps.word_after(word, number))))
        .filter(|(_, bits)| *bits != 0)
}

/// The slots of which any of `kinds` changed after a number, in ascending order.
///
/// O(slots that changed), at most 64 comparisons for each of them and each kind, and a look at 8
/// bytes for each 4096 slots.
pub(super) fn slots_after<const N: usize>(kinds: [&Stamps; N], number: u64) -> impl Iterator<Item = u32> {
    words_after(kinds, number).flat_map(|(word, bits)| bits_of(bits).map(move |bit| (word * BITS + bit) as u32))
}

/// The number of slots of which any of `kinds` changed after a number.
pub(super) fn count_after<const N: usize>(kinds: [&Stamps; N], number: u64) -> usize {
    words_after(kinds, number).map(|(_, bits)| bits.count_ones() as usize).sum()
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::*;

    #[test]
    fn readers_find_what_changed_after_any_number() {
        let mut stamps = [Stamps::default(), Stamps::default()];
        let mut last: [BTreeMap<u32, u64>; 2] = Default::default();
        // Slots around the ends of words, of words of words, and far apart.
        let slots: Vec<u32> =
            [0, 63, 64, 4095, 4096, 100_000, 1 << 20].into_iter().flat_map(|slot| [slot, slot + 1, slot + 2]).collect();
        assert_eq!(slots_after([&stamps[0]], 0).next(), None);
        for number in 1..2000 {
            let (kind, slot) = (number * 7 % 11 % 2, slots[number * 31 % 97 % slots.len()]);
            stamps[kind].set(slot, number as u64);
            last[kind].insert(slot, number as u64);
            assert_eq!(stamps[kind].get(slot), number as u64);
            for behind in [0, 1, 5, 100, number] {
                let after = (number - behind.min(number)) as u64;
                let later = |last: &BTreeMap<u32, u64>| -> BTreeSet<u32> {
                    last.iter().filter(|(_, number)| **number > after).map(|(slot, _)| *slot).collect()
                };
                let expected: BTreeSet<u32> = last.iter().flat_map(later).collect();
                let kinds = [&stamps[0], &stamps[1]];
                assert!(slots_after(kinds, after).eq(expected.iter().copied()));
                assert_eq!(count_after(kinds, after), expected.len());
                assert!(slots_after([&stamps[0]], after).eq(later(&last[0])));
            }
        }
        let memory = stamps[0].memory_bytes() / 8;
        assert!((1 << 20..3 << 20).contains(&memory), "{memory} numbers for 2^20 slots");
    }
}

//! When each slot changed last.

/// The bits of a word.
const BITS: usize = u64::BITS as usize;

/// The number of the last change of each slot, 0 before the first one.
///
/// Above them lie the latest of each 64 slots and of each 4096, so that few changes among many slots
/// are found without a look at all of them. Takes 8 bytes for each slot up to the greatest one that
/// ever changed.
#[derive(Debug, Default)]
pub(super) struct Stamps {
    /// Of slots, of words of 64 slots, and of groups of 64 words.
    levels: [Vec<u64>; 3],
}

impl Stamps {
    /// The number of the last change of a slot.
    pub fn get(&self, slot: u32) -> u64 {
        self.levels[0].get(slot as usize).copied().unwrap_or(0)
    }

    /// Records a change. Numbers must not fall. O(1).
    pub fn set(&mut self, slot: u32, number: u64) {
        let mut index = slot as usize;
        for level in &mut self.levels {
            if level.len() <= index {
                level.resize((index / BITS + 1) * BITS, 0);
            }
            level[index] = number;
            index /= BITS;
        }
    }

    /// Which of the numbers below one are later than another, as bits.
    fn below(&self, level: usize, index: usize, than: u64) -> u64 {
        match self.levels[level].get(index) {
            Some(latest) if *latest > than => later(&self.levels[level - 1][index * BITS..][..BITS], than),
            _ => 0,
        }
    }

    /// The size in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.levels.iter().map(|level| size_of::<u64>() * level.capacity()).sum()
    }
}

/// Which of 64 numbers, all below 2⁶³, are later than another, as bits.
fn later(numbers: &[u64], than: u64) -> u64 {
    // The sign of the difference: comparisons of 64 bits are slow on older machines. Eight are independent.
    let eight = |numbers: &[u64]| (0..8).fold(0, |bits, i| bits | ((than.wrapping_sub(numbers[i]) >> 63) << i));
    numbers.chunks_exact(8).rev().fold(0, |bits, numbers| (bits << 8) | eight(numbers))
}

/// The numbers of the bits that are set, in ascending order.
fn bits_of(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (bits != 0).then(|| bits.trailing_zeros() as usize)?;
        bits &= bits - 1;
        Some(bit)
    })
}

/// As [`Stamps::below`] for several kinds of changes.
fn below<const N: usize>(kinds: [&Stamps; N], level: usize, index: usize, than: u64) -> u64 {
    kinds.iter().fold(0, |bits, stamps| bits | stamps.below(level, index, than))
}

/// The words that have slots of which any of `kinds` changed after a number, as indices.
fn words_after<const N: usize>(kinds: [&Stamps; N], number: u64) -> impl Iterator<Item = usize> {
    let groups = kinds.iter().map(|stamps| stamps.levels[2].len()).max().unwrap_or(0);
    (0..groups).flat_map(move |group| bits_of(below(kinds, 2, group, number)).map(move |bit| group * BITS + bit))
}

/// The slots of which any of `kinds` changed after a number, in ascending order.
///
/// O(slots that changed), at most 128 comparisons for each of them and each kind, and a look at 8
/// bytes for each 4096 slots.
pub(super) fn slots_after<const N: usize>(kinds: [&Stamps; N], number: u64) -> impl Iterator<Item = u32> {
    words_after(kinds, number)
        .flat_map(move |word| bits_of(below(kinds, 1, word, number)).map(move |bit| (word * BITS + bit) as u32))
}

/// The number of slots of which any of `kinds` changed after a number.
pub(super) fn count_after<const N: usize>(kinds: [&Stamps; N], number: u64) -> usize {
    words_after(kinds, number).map(|word| below(kinds, 1, word, number).count_ones() as usize).sum()
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

//! A set of slots that yields them in ascending order.

/// The bits of a word.
const BITS: usize = u64::BITS as usize;

/// Slots as bits, and above them one bit for each word that has some, so that few slots of many are
/// found without a look at all of them.
///
/// An insertion and a removal are O(1). Emptying the set is O(its slots + the greatest slot so far
/// / 4096).
#[derive(Debug, Default)]
pub(super) struct SlotSet {
    words: Vec<u64>,
    /// The words that are not 0.
    in_use: Vec<u64>,
    len: usize,
}

/// The numbers of the bits that are set, in ascending order.
fn bits_of(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (bits != 0).then(|| bits.trailing_zeros() as usize)?;
        bits &= bits - 1;
        Some(bit)
    })
}

/// The index of the word that holds a bit, and the word with that bit alone.
fn place(bit: usize) -> (usize, u64) {
    (bit / BITS, 1 << (bit % BITS))
}

impl SlotSet {
    pub fn contains(&self, slot: u32) -> bool {
        let (word, bit) = place(slot as usize);
        self.words.get(word).is_some_and(|bits| bits & bit != 0)
    }

    /// Adds a slot. Returns whether it was absent.
    pub fn insert(&mut self, slot: u32) -> bool {
        let (word, bit) = place(slot as usize);
        if self.words.len() <= word {
            self.words.resize(word + 1, 0);
            self.in_use.resize(word / BITS + 1, 0);
        }
        let is_new = self.words[word] & bit == 0;
        self.words[word] |= bit;
        let (above, bit_above) = place(word);
        self.in_use[above] |= bit_above;
        self.len += usize::from(is_new);
        is_new
    }

    /// Removes a slot. Returns whether it was present.
    pub fn remove(&mut self, slot: u32) -> bool {
        if !self.contains(slot) {
            return false;
        }
        let (word, bit) = place(slot as usize);
        self.words[word] &= !bit;
        if self.words[word] == 0 {
            let (above, bit_above) = place(word);
            self.in_use[above] &= !bit_above;
        }
        self.len -= 1;
        true
    }

    /// Adds the slots of a set, without those of another one. O(words that hold some).
    pub fn extend(&mut self, slots: &Self, without: &Self) {
        if self.words.len() < slots.words.len() {
            self.words.resize(slots.words.len(), 0);
            self.in_use.resize(slots.in_use.len(), 0);
        }
        for (above, in_use) in slots.in_use.iter().enumerate() {
            for bit in bits_of(*in_use) {
                let word = above * BITS + bit;
                let except = without.words.get(word).copied().unwrap_or(0) | self.words[word];
                let new = slots.words[word] & !except;
                self.words[word] |= new;
                self.in_use[above] |= u64::from(self.words[word] != 0) << bit;
                self.len += new.count_ones() as usize;
            }
        }
    }

    /// Keeps the slots for which `keep` returns true, and returns what it has added up.
    ///
    /// `keep` is called once for each slot, on rayon's threads, with the item of that index and a
    /// sum. Each sum starts at its default, and `merge` adds them up in any order. There must be an
    /// item for each slot of the set.
    #[cfg(feature = "parallel")]
    pub fn retain_on_threads<T: Send, S: Default + Send>(
        &mut self,
        items: &mut [T],
        keep: impl Fn(&mut S, &mut T) -> bool + Sync,
        merge: impl Fn(S, S) -> S + Sync,
    ) -> S {
        use rayon::prelude::*;
        let Self { words, in_use, len } = self;
        let parts = in_use.par_iter_mut().zip(words.par_chunks_mut(BITS)).zip(items.par_chunks_mut(BITS * BITS));
        let retain = |((in_use, words), items): ((&mut u64, &mut [u64]), &mut [T])| {
            let (mut sum, mut removed) = (S::default(), 0_usize);
            for word in bits_of(*in_use) {
                for bit in bits_of(words[word]) {
                    if !keep(&mut sum, &mut items[word * BITS + bit]) {
                        words[word] &= !(1 << bit);
                        removed += 1;
                    }
                }
                *in_use &= !(u64::from(words[word] == 0) << word);
            }
            (sum, removed)
        };
        let (sum, removed) = parts.map(retain).reduce(|| (S::default(), 0), |(a, m), (b, n)| (merge(a, b), m + n));
        *len -= removed;
        sum
    }

    /// Empties the set and returns how many slots it held. Keeps the memory.
    pub fn clear(&mut self) -> usize {
        let count = self.len;
        self.drain_words(|_, _| {});
        count
    }

    /// Empties the set and returns its slots in ascending order. Allocates the returned list alone,
    /// and nothing for an empty set.
    pub fn take(&mut self) -> Vec<u32> {
        let mut slots = Vec::with_capacity(self.len);
        self.drain_words(|word, bits| slots.extend(bits_of(bits).map(|bit| (word * BITS + bit) as u32)));
        slots
    }

    /// Empties the set, and passes on each word that was not 0, with its index.
    fn drain_words(&mut self, mut each: impl FnMut(usize, u64)) {
        if self.len == 0 {
            return;
        }
        self.len = 0;
        for (above, in_use) in self.in_use.iter_mut().enumerate() {
            for bit in bits_of(std::mem::take(in_use)) {
                let word = above * BITS + bit;
                each(word, std::mem::take(&mut self.words[word]));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn a_set_of_slots_does_what_a_sorted_set_does() {
        let (mut set, mut sorted) = (SlotSet::default(), BTreeSet::new());
        // Slots around the ends of words, of words of words, and far apart.
        let slots: Vec<u32> =
            [0, 63, 64, 4095, 4096, 100_000, 1 << 20].into_iter().flat_map(|slot| [slot, slot + 1, slot + 2]).collect();
        for step in 0..20_000_usize {
            let slot = slots[step * 31 % 97 % slots.len()];
            match step * 17 % 101 {
                0 => assert!(set.take().into_iter().eq(std::mem::take(&mut sorted))),
                50 => assert_eq!(set.clear(), std::mem::take(&mut sorted).len()),
                step if step.is_multiple_of(3) => assert_eq!(set.remove(slot), sorted.remove(&slot)),
                _ => assert_eq!(set.insert(slot), sorted.insert(slot)),
            }
            assert_eq!((set.len, set.contains(slot)), (sorted.len(), sorted.contains(&slot)));
        }
        assert!(set.take().into_iter().eq(sorted));
        assert!(set.words.iter().chain(&set.in_use).all(|bits| *bits == 0));
    }

    fn set_of(slots: impl IntoIterator<Item = u32>) -> SlotSet {
        let mut set = SlotSet::default();
        for slot in slots {
            set.insert(slot);
        }
        set
    }

    #[cfg(feature = "parallel")]
    #[test]
    fn a_set_keeps_what_it_is_told_to_keep() {
        for step in [1, 7, 5000] {
            let slots = (0..30_000).step_by(step);
            let mut set = set_of(slots.clone());
            let mut items: Vec<u32> = (0..40_000).collect();
            let keep = |sum: &mut u64, item: &mut u32| {
                *sum += u64::from(*item);
                *item += 1;
                item.is_multiple_of(3) && *item > 200
            };
            let sum = set.retain_on_threads(&mut items, keep, |a, b| a + b);
            assert_eq!(sum, slots.clone().map(u64::from).sum::<u64>());
            let raised = |(slot, item): (usize, &u32)| {
                *item as usize == slot + usize::from(slot < 30_000 && slot.is_multiple_of(step))
            };
            assert!(items.iter().enumerate().all(raised), "each slot once");
            let kept: Vec<u32> = slots.filter(|slot| (slot + 1).is_multiple_of(3) && slot + 1 > 200).collect();
            assert_eq!((set.len, set.take()), (kept.len(), kept));
            assert!(set.in_use.iter().all(|bits| *bits == 0), "words without slots are not in use");
        }
    }

    #[test]
    fn a_set_takes_in_another_without_a_third() {
        let mut set = set_of([1, 64, 5000]);
        set.extend(&set_of([1, 2, 64, 70, 9000, 100_000]), &set_of([2, 9000]));
        assert_eq!(set.len, 5);
        assert_eq!(set.take(), [1, 64, 70, 5000, 100_000]);
        set.extend(&set_of([2]), &set_of([2]));
        assert!(set.take().is_empty() && set.in_use.iter().all(|bits| *bits == 0));
    }
}

//! A set of slots that yields them in ascending order.

/// The bits of a word.
pub(super) const BITS: usize = u64::BITS as usize;

/// Slots as bits, and above them one bit for each word that has some, so that few slots of many are
/// found without a look at all of them.
///
/// An insertion is O(1). Emptying the set is O(its slots + the greatest slot so far
/// / 4096).
#[derive(Debug, Default)]
pub(super) struct SlotSet {
    words: Vec<u64>,
    /// The words that are not 0.
    in_use: Vec<u64>,
    len: usize,
}

/// The numbers of the bits that are set, in ascending order.
pub(super) fn bits_of(mut bits: u64) -> impl Iterator<Item = usize> {
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

    /// The number of slots.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Empties the set, and passes on each slot in ascending order. Keeps the memory.
    pub fn drain(&mut self, mut each: impl FnMut(u32)) {
        if self.len == 0 {
            return;
        }
        self.len = 0;
        for (above, in_use) in self.in_use.iter_mut().enumerate() {
            for bit in bits_of(std::mem::take(in_use)) {
                let word = above * BITS + bit;
                bits_of(std::mem::take(&mut self.words[word])).for_each(|bit| each((word * BITS + bit) as u32));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn drained(set: &mut SlotSet) -> Vec<u32> {
        let mut slots = Vec::new();
        set.drain(|slot| slots.push(slot));
        slots
    }

    #[test]
    fn a_set_of_slots_does_what_a_sorted_set_does() {
        let (mut set, mut sorted) = (SlotSet::default(), BTreeSet::new());
        // Slots around the ends of words, of words of words, and far apart.
        let slots: Vec<u32> =
            [0, 63, 64, 4095, 4096, 100_000, 1 << 20].into_iter().flat_map(|slot| [slot, slot + 1, slot + 2]).collect();
        for step in 0..20_000_usize {
            let slot = slots[step * 31 % 97 % slots.len()];
            match step * 17 % 101 {
                0 => assert!(drained(&mut set).into_iter().eq(std::mem::take(&mut sorted))),
                _ => assert_eq!(set.insert(slot), sorted.insert(slot)),
            }
            assert_eq!(set.len(), sorted.len());
        }
        assert!(drained(&mut set).into_iter().eq(sorted));
        assert!(set.words.iter().chain(&set.in_use).all(|bits| *bits == 0));
    }

    #[cfg(feature = "parallel")]
    #[test]
    fn a_set_keeps_what_it_is_told_to_keep() {
        for step in [1, 7, 5000] {
            let slots = (0..30_000).step_by(step);
            let mut set = SlotSet::default();
            for slot in slots.clone() {
                set.insert(slot);
            }
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
            assert_eq!((set.len(), drained(&mut set)), (kept.len(), kept));
            assert!(set.in_use.iter().all(|bits| *bits == 0), "words without slots are not in use");
        }
    }
}

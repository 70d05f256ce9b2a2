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
        self.drain_words(|word, mut bits| {
            while bits != 0 {
                slots.push((word * BITS) as u32 + bits.trailing_zeros());
                bits &= bits - 1;
            }
        });
        slots
    }

    /// Empties the set, and passes on each word that was not 0, with its index.
    fn drain_words(&mut self, mut each: impl FnMut(usize, u64)) {
        if self.len == 0 {
            return;
        }
        self.len = 0;
        for (above, in_use) in self.in_use.iter_mut().enumerate() {
            while *in_use != 0 {
                let word = above * BITS + in_use.trailing_zeros() as usize;
                each(word, std::mem::take(&mut self.words[word]));
                *in_use &= *in_use - 1;
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
                step if step % 3 == 0 => assert_eq!(set.remove(slot), sorted.remove(&slot)),
                _ => assert_eq!(set.insert(slot), sorted.insert(slot)),
            }
            assert_eq!((set.len, set.contains(slot)), (sorted.len(), sorted.contains(&slot)));
        }
        assert!(set.take().into_iter().eq(sorted));
        assert!(set.words.iter().chain(&set.in_use).all(|bits| *bits == 0));
    }
}

//! Who waits for a rebuild, the best value at hand.

use crate::keys::TreeKey;
use crate::simd::{Job, with_vectors};

/// Scores looked at together: those of all blocks are the blocks' greatest, so that the best of 10,000 is found among 80
/// and then among 128.
const BLOCK: usize = 128;

/// Above all scores without it; floats of one sign order as their bits do.
const URGENT: u32 = 1 << 31;

/// Trees with scores. Trees know their own place, which changes as others leave.
#[derive(Debug, Default)]
pub(crate) struct Queue {
    keys: Vec<TreeKey>,
    /// Bits of a score that is not negative, with [`URGENT`].
    scores: Vec<u32>,
    /// The greatest of each block.
    blocks: Vec<u32>,
    /// Blocks whose greatest is not known.
    stale: Vec<bool>,
}

impl Queue {
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    pub fn key(&self, place: usize) -> TreeKey {
        self.keys[place]
    }

    /// Its place.
    pub fn push(&mut self, key: TreeKey, score: f32, is_urgent: bool) -> usize {
        let place = self.keys.len();
        self.keys.push(key);
        self.scores.push(0);
        if self.blocks.len() * BLOCK <= place {
            self.blocks.push(0);
            self.stale.push(false);
        }
        self.set(place, score, is_urgent);
        place
    }

    pub fn set(&mut self, place: usize, score: f32, is_urgent: bool) {
        // NaN becomes 0.
        self.set_bits(place, score.max(0.0).to_bits() | if is_urgent { URGENT } else { 0 });
    }

    fn set_bits(&mut self, place: usize, bits: u32) {
        let former = std::mem::replace(&mut self.scores[place], bits);
        let block = place / BLOCK;
        if bits >= self.blocks[block] {
            self.blocks[block] = bits;
            self.stale[block] = false;
        } else if former == self.blocks[block] {
            self.stale[block] = true;
        }
    }

    /// Takes one out of the choice for the best, until [`Queue::restore`] gets what this returns.
    pub fn set_aside(&mut self, place: usize) -> u32 {
        let bits = self.scores[place];
        self.set_bits(place, 0);
        bits
    }

    /// Undoes [`Queue::set_aside`].
    pub fn restore(&mut self, place: usize, bits: u32) {
        self.set_bits(place, bits);
    }

    /// Takes one out. The last takes its place: the key of that one, if it is another.
    pub fn remove(&mut self, place: usize) -> Option<TreeKey> {
        let last = self.keys.len() - 1;
        let bits = self.scores[last];
        self.keys.swap_remove(place);
        self.scores.swap_remove(place);
        self.stale[last / BLOCK] = true;
        self.blocks.truncate(last.div_ceil(BLOCK));
        self.stale.truncate(last.div_ceil(BLOCK));
        if place == last {
            return None;
        }
        let block = place / BLOCK;
        self.stale[block] = true;
        self.blocks[block] = self.blocks[block].max(bits);
        Some(self.keys[place])
    }

    /// The place of the best, the first of equals; `None` if all have a score of 0.
    pub fn best(&mut self) -> Option<usize> {
        if self.keys.is_empty() {
            return None;
        }
        for (block, is_stale) in self.stale.iter_mut().enumerate().filter(|(_, is_stale)| **is_stale) {
            let end = self.scores.len().min((block + 1) * BLOCK);
            self.blocks[block] = greatest(&self.scores[block * BLOCK..end]);
            *is_stale = false;
        }
        let most = greatest(&self.blocks);
        if most == 0 {
            return None;
        }
        let block = self.blocks.iter().position(|bits| *bits == most)?;
        let place = self.scores[block * BLOCK..].iter().position(|bits| *bits == most)?;
        Some(block * BLOCK + place)
    }
}

/// Of unsigned integers, which are compared eight at a time where the machine can.
fn greatest(bits: &[u32]) -> u32 {
    with_vectors(Greatest(bits))
}

struct Greatest<'a>(&'a [u32]);

impl Job for Greatest<'_> {
    type Output = u32;

    #[inline(always)]
    fn run(self) -> u32 {
        self.0.iter().fold(0, |most, bits| most.max(*bits))
    }
}

#[cfg(test)]
mod tests {
    use slotmap::{Key, SlotMap};

    use super::*;

    #[test]
    fn the_best_is_that_of_a_plain_list() {
        let mut keys = SlotMap::<TreeKey, ()>::with_key();
        let (mut queue, mut plain) = (Queue::default(), Vec::<(TreeKey, f32, bool)>::new());
        let mut state = 1_u32;
        let mut next = move |below: usize| {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as usize % below
        };
        for step in 0..20_000 {
            let growing = step / 2000 % 2 == 0;
            match next(4) {
                0 if !plain.is_empty() => {
                    let place = next(plain.len());
                    let (score, is_urgent) = (1.0 + next(50) as f32, next(20) == 0);
                    queue.set(place, score, is_urgent);
                    (plain[place].1, plain[place].2) = (score, is_urgent);
                }
                1 | 2 if !plain.is_empty() && !growing => {
                    let place = next(plain.len());
                    let moved = queue.remove(place);
                    plain.swap_remove(place);
                    assert_eq!(moved, plain.get(place).map(|entry| entry.0));
                }
                _ => {
                    let key = keys.insert(());
                    let (score, is_urgent) = (1.0 + next(1000) as f32, next(20) == 0);
                    assert_eq!(queue.push(key, score, is_urgent), plain.len());
                    plain.push((key, score, is_urgent));
                }
            }
            assert_eq!(queue.len(), plain.len());
            let best = plain.iter().map(|entry| (entry.2, entry.1)).reduce(|a, b| if b > a { b } else { a });
            let found = queue.best().map(|place| (plain[place].2, plain[place].1, queue.key(place) == plain[place].0));
            assert_eq!(found, best.map(|(is_urgent, score)| (is_urgent, score, true)));
        }
    }

    #[test]
    fn what_is_not_a_number_comes_last() {
        let mut queue = Queue::default();
        for score in [f32::NAN, 1.0, f32::INFINITY, -1.0, 0.0] {
            queue.push(TreeKey::null(), score, false);
        }
        assert_eq!(queue.best(), Some(2));
        queue.set(2, f32::NAN, false);
        assert_eq!(queue.best(), Some(1));
        let bits = queue.set_aside(1);
        assert_eq!(queue.best(), None);
        queue.restore(1, bits);
        assert_eq!(queue.best(), Some(1));
    }
}

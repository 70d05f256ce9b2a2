//! The queue of trees that request a rebuild, by priority.

use crate::keys::TreeKey;
use crate::simd::{Job, with_vectors};

/// Scores per block. The maximum of each block is kept, so that the best of 10,000 trees is found
/// among 80 blocks and then among 128 scores.
const BLOCK: usize = 128;

/// Added to the bits of the scores of urgent requests, which puts them above all others. The bits
/// of floats of one sign have the order of the floats.
const URGENT: u32 = 1 << 31;

/// Trees with scores, in no order. The caller keeps the index of each tree, which changes when
/// another is removed.
///
/// To set a score takes O(1), to find the best O(n / 128) and 128 scores of each block whose
/// maximum is unknown.
#[derive(Debug, Default)]
pub(crate) struct PriorityQueue {
    keys: Vec<TreeKey>,
    /// The bits of the scores, which are not negative, with [`URGENT`].
    scores: Vec<u32>,
    /// The maximum of each block, or an upper bound if the block is stale.
    block_maxima: Vec<u32>,
    /// Whether the maximum of each block is unknown.
    is_stale: Vec<bool>,
}

impl PriorityQueue {
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// The tree at an index.
    pub fn key(&self, index: usize) -> TreeKey {
        self.keys[index]
    }

    /// Adds a tree and returns its index.
    pub fn push(&mut self, key: TreeKey, score: f32, is_urgent: bool) -> usize {
        let index = self.keys.len();
        self.keys.push(key);
        self.scores.push(0);
        if self.block_maxima.len() * BLOCK <= index {
            self.block_maxima.push(0);
            self.is_stale.push(false);
        }
        self.set(index, score, is_urgent);
        index
    }

    /// Changes the score of the tree at an index. NaN and negative scores count as 0.
    pub fn set(&mut self, index: usize, score: f32, is_urgent: bool) {
        self.set_bits(index, score.max(0.0).to_bits() | if is_urgent { URGENT } else { 0 });
    }

    fn set_bits(&mut self, index: usize, bits: u32) {
        let former = std::mem::replace(&mut self.scores[index], bits);
        let block = index / BLOCK;
        if bits >= self.block_maxima[block] {
            self.block_maxima[block] = bits;
            self.is_stale[block] = false;
        } else if former == self.block_maxima[block] {
            self.is_stale[block] = true;
        }
    }

    /// Hides a tree from [`PriorityQueue::best`] until [`PriorityQueue::resume`] is called with
    /// the value that this returns.
    pub fn suspend(&mut self, index: usize) -> u32 {
        let bits = self.scores[index];
        self.set_bits(index, 0);
        bits
    }

    /// Undoes [`PriorityQueue::suspend`].
    pub fn resume(&mut self, index: usize, bits: u32) {
        self.set_bits(index, bits);
    }

    /// Removes the tree at an index. The last tree moves to this index; returns its key, or `None`
    /// if the removed tree was the last.
    pub fn remove(&mut self, index: usize) -> Option<TreeKey> {
        let last = self.keys.len() - 1;
        let bits = self.scores[last];
        self.keys.swap_remove(index);
        self.scores.swap_remove(index);
        self.is_stale[last / BLOCK] = true;
        self.block_maxima.truncate(last.div_ceil(BLOCK));
        self.is_stale.truncate(last.div_ceil(BLOCK));
        if index == last {
            return None;
        }
        let block = index / BLOCK;
        self.is_stale[block] = true;
        self.block_maxima[block] = self.block_maxima[block].max(bits);
        Some(self.keys[index])
    }

    /// The index of the tree with the greatest score, the first of equal ones; `None` if all scores
    /// are 0.
    pub fn best(&mut self) -> Option<usize> {
        if self.keys.is_empty() {
            return None;
        }
        for (block, is_stale) in self.is_stale.iter_mut().enumerate().filter(|(_, is_stale)| **is_stale) {
            let end = self.scores.len().min((block + 1) * BLOCK);
            self.block_maxima[block] = max_of(&self.scores[block * BLOCK..end]);
            *is_stale = false;
        }
        let max = max_of(&self.block_maxima);
        if max == 0 {
            return None;
        }
        let block = self.block_maxima.iter().position(|bits| *bits == max)?;
        let offset = self.scores[block * BLOCK..].iter().position(|bits| *bits == max)?;
        Some(block * BLOCK + offset)
    }
}

/// The maximum, or 0 of none. Unsigned integers are compared eight at a time where the machine can.
fn max_of(bits: &[u32]) -> u32 {
    with_vectors(MaxOf(bits))
}

struct MaxOf<'a>(&'a [u32]);

impl Job for MaxOf<'_> {
    type Output = u32;

    #[inline(always)]
    fn run(self) -> u32 {
        self.0.iter().fold(0, |max, bits| max.max(*bits))
    }
}

#[cfg(test)]
mod tests {
    use slotmap::{Key, SlotMap};

    use super::*;

    #[test]
    fn the_best_is_the_same_as_in_a_plain_list_after_random_operations() {
        let mut keys = SlotMap::<TreeKey, ()>::with_key();
        let (mut queue, mut list) = (PriorityQueue::default(), Vec::<(TreeKey, f32, bool)>::new());
        let mut state = 1_u32;
        let mut random_below = move |end: usize| {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as usize % end
        };
        for step in 0..20_000 {
            let is_growing = step / 2000 % 2 == 0;
            match random_below(4) {
                0 if !list.is_empty() => {
                    let index = random_below(list.len());
                    let (score, is_urgent) = (1.0 + random_below(50) as f32, random_below(20) == 0);
                    queue.set(index, score, is_urgent);
                    (list[index].1, list[index].2) = (score, is_urgent);
                }
                1 | 2 if !list.is_empty() && !is_growing => {
                    let index = random_below(list.len());
                    let moved = queue.remove(index);
                    list.swap_remove(index);
                    assert_eq!(moved, list.get(index).map(|entry| entry.0));
                }
                _ => {
                    let key = keys.insert(());
                    let (score, is_urgent) = (1.0 + random_below(1000) as f32, random_below(20) == 0);
                    assert_eq!(queue.push(key, score, is_urgent), list.len());
                    list.push((key, score, is_urgent));
                }
            }
            assert_eq!(queue.len(), list.len());
            let best = list.iter().map(|entry| (entry.2, entry.1)).reduce(|a, b| if b > a { b } else { a });
            let found = queue.best().map(|index| (list[index].2, list[index].1, queue.key(index) == list[index].0));
            assert_eq!(found, best.map(|(is_urgent, score)| (is_urgent, score, true)));
        }
    }

    #[test]
    fn scores_that_are_nan_or_negative_and_suspended_trees_are_never_the_best() {
        let mut queue = PriorityQueue::default();
        for score in [f32::NAN, 1.0, f32::INFINITY, -1.0, 0.0] {
            queue.push(TreeKey::null(), score, false);
        }
        assert_eq!(queue.best(), Some(2));
        queue.set(2, f32::NAN, false);
        assert_eq!(queue.best(), Some(1));
        let bits = queue.suspend(1);
        assert_eq!(queue.best(), None);
        queue.resume(1, bits);
        assert_eq!(queue.best(), Some(1));
    }
}

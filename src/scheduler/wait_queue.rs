//! The queue of trees that wait, in order of arrival.

use std::collections::VecDeque;

use crate::keys::TreeKey;

/// Vacant entries are removed once there are twice as many entries as trees and this many more.
const MAX_VACANT: usize = 64;

/// Trees in order of arrival. Each entry has a sequence number, by which it is removed.
#[derive(Debug, Default)]
pub(crate) struct WaitQueue {
    /// Sorted by sequence number; `None` for trees that were removed. The first entry has a tree.
    entries: VecDeque<(u64, Option<TreeKey>)>,
    last_sequence: u64,
    /// Entries with a tree.
    count: usize,
}

impl WaitQueue {
    /// Appends a tree and returns its sequence number.
    pub fn push(&mut self, key: TreeKey) -> u64 {
        self.last_sequence += 1;
        self.entries.push_back((self.last_sequence, Some(key)));
        self.count += 1;
        self.last_sequence
    }

    /// The tree that has waited longest.
    pub fn first(&self) -> Option<TreeKey> {
        self.entries.front().and_then(|(_, key)| *key)
    }

    /// Removes the tree with this sequence number, if there is one. Amortised O(log n).
    pub fn remove(&mut self, sequence: u64) {
        let Ok(index) = self.entries.binary_search_by_key(&sequence, |(sequence, _)| *sequence) else { return };
        if self.entries[index].1.take().is_some() {
            self.count -= 1;
        }
        while let Some((_, None)) = self.entries.front() {
            self.entries.pop_front();
        }
        if self.entries.len() > 2 * self.count + MAX_VACANT {
            self.entries.retain(|(_, key)| key.is_some());
        }
    }
}

#[cfg(test)]
mod tests {
    use slotmap::SlotMap;

    use super::*;

    #[test]
    fn the_first_tree_is_the_oldest_that_was_not_removed() {
        let mut keys = SlotMap::<TreeKey, ()>::with_key();
        let (mut queue, mut expected) = (WaitQueue::default(), Vec::new());
        assert_eq!(queue.first(), None);
        for step in 0..5000_usize {
            if step % 7 < 3 || expected.is_empty() {
                let key = keys.insert(());
                expected.push((queue.push(key), key));
            } else {
                let (sequence, _) = expected.remove(step * 31 % expected.len());
                queue.remove(sequence);
                // The second call has no effect.
                queue.remove(sequence);
            }
            assert_eq!(queue.first(), expected.first().map(|(_, key)| *key));
            assert!(queue.entries.len() <= 2 * expected.len() + MAX_VACANT + 1);
        }
        queue.remove(u64::MAX);
    }

    #[test]
    fn vacant_entries_behind_a_tree_that_stays_do_not_accumulate() {
        let mut keys = SlotMap::<TreeKey, ()>::with_key();
        let mut queue = WaitQueue::default();
        queue.push(keys.insert(()));
        for _ in 0..10_000 {
            let sequence = queue.push(keys.insert(()));
            queue.remove(sequence);
        }
        assert!(queue.entries.len() <= MAX_VACANT + 3);
    }
}

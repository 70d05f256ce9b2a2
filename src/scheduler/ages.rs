//! Who has waited longest.

use std::collections::VecDeque;

use crate::keys::TreeKey;

/// Who left is swept out when so many more have left than wait.
const SWEPT: usize = 64;

/// Trees in the order in which they came. Each knows its ticket, by which it leaves.
#[derive(Debug, Default)]
pub(crate) struct Ages {
    /// By ticket; `None` for who has left. The first is always someone.
    came: VecDeque<(u64, Option<TreeKey>)>,
    next: u64,
    waiting: usize,
}

impl Ages {
    /// Puts a tree behind all others; its ticket.
    pub fn push(&mut self, key: TreeKey) -> u64 {
        self.next += 1;
        self.came.push_back((self.next, Some(key)));
        self.waiting += 1;
        self.next
    }

    /// Whoever came first.
    pub fn first(&self) -> Option<TreeKey> {
        self.came.front().and_then(|(_, key)| *key)
    }

    /// Takes out who has this ticket. O(log n), and now and then O(n) after as many calls.
    pub fn take(&mut self, ticket: u64) {
        let Ok(place) = self.came.binary_search_by_key(&ticket, |(ticket, _)| *ticket) else { return };
        if self.came[place].1.take().is_some() {
            self.waiting -= 1;
        }
        while let Some((_, None)) = self.came.front() {
            self.came.pop_front();
        }
        if self.came.len() > 2 * self.waiting + SWEPT {
            self.came.retain(|(_, key)| key.is_some());
        }
    }
}

#[cfg(test)]
mod tests {
    use slotmap::SlotMap;

    use super::*;

    #[test]
    fn the_first_is_who_came_first_of_those_that_are_left() {
        let mut keys = SlotMap::<TreeKey, ()>::with_key();
        let (mut ages, mut plain) = (Ages::default(), Vec::new());
        assert_eq!(ages.first(), None);
        for step in 0..5000_usize {
            if step % 7 < 3 || plain.is_empty() {
                let key = keys.insert(());
                plain.push((ages.push(key), key));
            } else {
                let (ticket, _) = plain.remove(step * 31 % plain.len());
                ages.take(ticket);
                // Twice is once.
                ages.take(ticket);
            }
            assert_eq!(ages.first(), plain.first().map(|(_, key)| *key));
            assert!(ages.came.len() <= 2 * plain.len() + SWEPT + 1);
        }
        ages.take(u64::MAX);
    }

    #[test]
    fn who_comes_and_goes_behind_one_that_stays_leaves_nothing_behind() {
        let mut keys = SlotMap::<TreeKey, ()>::with_key();
        let mut ages = Ages::default();
        ages.push(keys.insert(()));
        for _ in 0..10_000 {
            let ticket = ages.push(keys.insert(()));
            ages.take(ticket);
        }
        assert!(ages.came.len() <= SWEPT + 3);
    }
}

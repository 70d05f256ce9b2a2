//! Doubly linked lists.

use std::ops::{Index, IndexMut};

/// Stands for no item.
const NONE: u32 = u32::MAX;

/// Some lists of items that are identified by numbers: 0, 1, 2 and so on. An item is in at most one
/// of the lists. All operations are O(1), on average for [`Lists::add`].
#[derive(Debug)]
pub(super) struct Lists<T> {
    ends: Vec<Ends>,
    items: Vec<Item<T>>,
}

/// The ends of one list.
#[derive(Clone, Copy, Debug)]
struct Ends {
    first: u32,
    last: u32,
}

/// A value and its neighbours.
#[derive(Clone, Copy, Debug)]
struct Item<T> {
    before: u32,
    after: u32,
    value: T,
}

fn number(number: u32) -> Option<usize> {
    (number != NONE).then_some(number as usize)
}

impl<T> Lists<T> {
    /// Some empty lists, and no items.
    pub fn new(count: usize) -> Self {
        Self { ends: vec![Ends { first: NONE, last: NONE }; count], items: Vec::new() }
    }

    /// Adds an item, which is in no list, and returns its number.
    pub fn add(&mut self, value: T) -> usize {
        self.items.push(Item { before: NONE, after: NONE, value });
        self.items.len() - 1
    }

    /// The first item of a list.
    pub fn first(&self, list: usize) -> Option<usize> {
        number(self.ends[list].first)
    }

    /// The item after another one in its list.
    pub fn after(&self, item: usize) -> Option<usize> {
        number(self.items[item].after)
    }

    /// Adds an item that is in no list at the end of one.
    pub fn push_back(&mut self, list: usize, item: usize) {
        let last = self.ends[list].last;
        self.join(list, last, item as u32);
        self.join(list, item as u32, NONE);
    }

    /// Adds an item that is in no list at the start of one.
    pub fn push_front(&mut self, list: usize, item: usize) {
        let first = self.ends[list].first;
        self.join(list, item as u32, first);
        self.join(list, NONE, item as u32);
    }

    /// Removes an item from its list.
    pub fn remove(&mut self, list: usize, item: usize) {
        let Item { before, after, .. } = self.items[item];
        self.join(list, before, after);
    }

    /// Lets an item follow another one. [`NONE`] in place of one of them makes the other an end.
    fn join(&mut self, list: usize, before: u32, after: u32) {
        match number(before) {
            Some(before) => self.items[before].after = after,
            None => self.ends[list].first = after,
        }
        match number(after) {
            Some(after) => self.items[after].before = before,
            None => self.ends[list].last = before,
        }
    }
}

impl<T> Index<usize> for Lists<T> {
    type Output = T;

    fn index(&self, item: usize) -> &T {
        &self.items[item].value
    }
}

impl<T> IndexMut<usize> for Lists<T> {
    fn index_mut(&mut self, item: usize) -> &mut T {
        &mut self.items[item].value
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;
    use crate::tree::testing::Rng;

    #[test]
    fn lists_hold_the_items_that_plain_lists_do_after_random_operations() {
        const ITEMS: usize = 40;
        let (mut lists, mut plain) = (Lists::new(3), [const { VecDeque::new() }; 3]);
        (0..ITEMS).for_each(|item| assert_eq!(lists.add(item), item));
        let mut rng = Rng(3);
        for _ in 0..20_000 {
            let item = rng.below(ITEMS);
            let list = rng.below(3);
            if let Some(holder) = plain.iter().position(|plain| plain.contains(&item)) {
                lists.remove(holder, item);
                plain[holder].retain(|other| *other != item);
            } else if rng.below(2) == 0 {
                lists.push_back(list, item);
                plain[list].push_back(item);
            } else {
                lists.push_front(list, item);
                plain[list].push_front(item);
            }
            for (list, plain) in plain.iter().enumerate() {
                let found = std::iter::successors(lists.first(list), |item| lists.after(*item));
                assert!(found.eq(plain.iter().copied()));
                assert!(plain.iter().all(|item| lists[*item] == *item));
            }
        }
    }
}

//! Doubly linked lists of keys.

use std::ops::{Index, IndexMut};

use slotmap::{Key, SecondaryMap};

/// Some lists of keys, each of which has a value. A key is in at most one of the lists, and the
/// caller knows which. All operations are O(1).
#[derive(Debug)]
pub(crate) struct LinkedLists<K: Key, T> {
    ends: Vec<Ends<K>>,
    items: SecondaryMap<K, Link<K, T>>,
}

/// The ends of one list.
#[derive(Clone, Copy, Debug)]
struct Ends<K> {
    first: Option<K>,
    last: Option<K>,
}

/// A value, and the neighbours of its key in the list.
#[derive(Debug)]
struct Link<K, T> {
    before: Option<K>,
    after: Option<K>,
    value: T,
}

impl<K: Key, T> LinkedLists<K, T> {
    /// Some empty lists, and no keys.
    pub fn new(count: usize) -> Self {
        Self { ends: vec![Ends { first: None, last: None }; count], items: SecondaryMap::new() }
    }

    /// Adds a key, which is in no list.
    pub fn insert(&mut self, key: K, value: T) {
        self.items.insert(key, Link { before: None, after: None, value });
    }

    /// Forgets a key that is in no list. Returns its value if there was one.
    pub fn forget(&mut self, key: K) -> Option<T> {
        self.items.remove(key).map(|item| item.value)
    }

    pub fn contains(&self, key: K) -> bool {
        self.items.contains_key(key)
    }

    pub fn first(&self, list: usize) -> Option<K> {
        self.ends[list].first
    }

    /// The key after another one in its list.
    pub fn after(&self, key: K) -> Option<K> {
        self.items[key].after
    }

    /// Adds a key that is in no list at the end of one.
    pub fn push_back(&mut self, list: usize, key: K) {
        let last = self.ends[list].last;
        self.join(list, last, Some(key));
        self.join(list, Some(key), None);
    }

    /// Removes a key from its list.
    pub fn remove(&mut self, list: usize, key: K) {
        let Link { before, after, .. } = self.items[key];
        self.join(list, before, after);
    }

    /// Lets a key follow another one. `None` in place of one of them makes the other an end.
    fn join(&mut self, list: usize, before: Option<K>, after: Option<K>) {
        match before {
            Some(before) => self.items[before].after = after,
            None => self.ends[list].first = after,
        }
        match after {
            Some(after) => self.items[after].before = before,
            None => self.ends[list].last = before,
        }
    }
}

impl<K: Key, T> Index<K> for LinkedLists<K, T> {
    type Output = T;

    fn index(&self, key: K) -> &T {
        &self.items[key].value
    }
}

impl<K: Key, T> IndexMut<K> for LinkedLists<K, T> {
    fn index_mut(&mut self, key: K) -> &mut T {
        &mut self.items[key].value
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use slotmap::SlotMap;

    use super::*;
    use crate::keys::TreeKey;
    use crate::tree::testing::Rng;

    #[test]
    fn lists_hold_the_keys_that_plain_lists_do_after_random_operations() {
        let mut keys = SlotMap::<TreeKey, ()>::with_key();
        let keys: Vec<TreeKey> = (0..40).map(|_| keys.insert(())).collect();
        let (mut lists, mut plain) = (LinkedLists::new(3), [const { VecDeque::new() }; 3]);
        keys.iter().for_each(|key| lists.insert(*key, *key));
        let mut rng = Rng(3);
        for _ in 0..20_000 {
            let key = keys[rng.below(keys.len())];
            if let Some(list) = plain.iter().position(|plain| plain.contains(&key)) {
                lists.remove(list, key);
                plain[list].retain(|other| *other != key);
            } else {
                let list = rng.below(3);
                lists.push_back(list, key);
                plain[list].push_back(key);
            }
            for (list, plain) in plain.iter().enumerate() {
                let found = std::iter::successors(lists.first(list), |key| lists.after(*key));
                assert!(found.eq(plain.iter().copied()));
                assert!(plain.iter().all(|key| lists[*key] == *key));
            }
        }
        assert_eq!(lists.forget(keys[7]), Some(keys[7]));
        assert!(!lists.contains(keys[7]) && lists.contains(keys[8]));
    }
}

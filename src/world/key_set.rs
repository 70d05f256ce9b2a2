//! A set of keys in one list, with insertion and removal in O(1).

use slotmap::{Key, SecondaryMap};

/// Keys of live entries, each once, in one contiguous list.
#[derive(Debug)]
pub(super) struct KeySet<K: Key> {
    /// In the order of insertion until a key is removed.
    keys: Vec<K>,
    /// The index of each key in the list.
    indices: SecondaryMap<K, u32>,
}

impl<K: Key> Default for KeySet<K> {
    fn default() -> Self {
        Self { keys: Vec::new(), indices: SecondaryMap::new() }
    }
}

impl<K: Key> KeySet<K> {
    pub fn contains(&self, key: K) -> bool {
        self.indices.contains_key(key)
    }

    /// Adds a key. Returns whether it was absent.
    pub fn insert(&mut self, key: K) -> bool {
        if self.contains(key) {
            return false;
        }
        self.indices.insert(key, self.keys.len() as u32);
        self.keys.push(key);
        true
    }

    /// Removes a key; the last key of the list takes its index. Returns whether it was present.
    /// O(1).
    pub fn remove(&mut self, key: K) -> bool {
        let Some(index) = self.indices.remove(key) else { return false };
        self.keys.swap_remove(index as usize);
        if let Some(moved) = self.keys.get(index as usize) {
            self.indices[*moved] = index;
        }
        true
    }

    /// Empties the set and yields its keys in the order of the list. Keeps the memory.
    pub fn drain(&mut self) -> impl Iterator<Item = K> {
        // One by one: clearing the map would visit every slot of the world.
        for key in &self.keys {
            self.indices.remove(*key);
        }
        self.keys.drain(..)
    }
}

#[cfg(test)]
mod tests {
    use slotmap::SlotMap;

    use super::*;
    use crate::keys::TreeKey;

    #[test]
    fn a_set_of_keys_does_what_a_plain_list_does() {
        let mut map = SlotMap::<TreeKey, ()>::with_key();
        let (mut set, mut list) = (KeySet::default(), Vec::new());
        for step in 0..4000_usize {
            match step * 31 % 7 {
                0..4 => {
                    let key = map.insert(());
                    assert!(set.insert(key) && !set.insert(key));
                    list.push(key);
                }
                4 | 5 if !list.is_empty() => {
                    let key = list.swap_remove(step * 17 % list.len());
                    assert!(set.remove(key) && !set.remove(key));
                    map.remove(key);
                }
                _ if step % 500 == 6 => assert!(set.drain().eq(list.drain(..))),
                _ => {}
            }
            assert_eq!(set.keys, list);
            assert!(list.iter().enumerate().all(|(index, key)| set.indices[*key] as usize == index));
            assert_eq!(set.indices.len(), list.len());
        }
    }
}

//! Values by key whose slots are numbered, as shaders number trees and instances.

use std::ops::{Index, IndexMut};

use slotmap::{Key, SlotMap};

use crate::keys::slot_of;

/// A map as `SlotMap<K, T>`, whose values lie in a list that threads can divide.
pub(super) struct SlotTable<K: Key, T> {
    keys: SlotMap<K, ()>,
    /// The live value of each slot that is or was in use, with its key.
    slots: Vec<Option<(K, T)>>,
}

impl<K: Key, T> Default for SlotTable<K, T> {
    fn default() -> Self {
        Self { keys: SlotMap::with_key(), slots: Vec::new() }
    }
}

impl<K: Key, T> SlotTable<K, T> {
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// The number of slots that are or were in use.
    pub fn slot_count(&self) -> usize {
        self.slots.len()
    }

    /// The bytes of the map itself, without what the values own.
    pub fn memory_bytes(&self) -> usize {
        // A slot map has one slot that it never uses.
        self.slots.capacity() * size_of::<Option<(K, T)>>() + (self.keys.capacity() + 1) * size_of::<u64>()
    }

    pub fn contains_key(&self, key: K) -> bool {
        self.keys.contains_key(key)
    }

    /// The key of the live value in a slot.
    pub fn key_at(&self, slot: u32) -> Option<K> {
        self.slots.get(slot as usize)?.as_ref().map(|(key, _)| *key)
    }

    pub fn get(&self, key: K) -> Option<&T> {
        let (live, value) = self.slots.get(slot_of(key) as usize)?.as_ref()?;
        (*live == key).then_some(value)
    }

    pub fn get_mut(&mut self, key: K) -> Option<&mut T> {
        let (live, value) = self.slots.get_mut(slot_of(key) as usize)?.as_mut()?;
        (*live == key).then_some(value)
    }

    pub fn insert(&mut self, value: T) -> K {
        let key = self.keys.insert(());
        let slot = slot_of(key) as usize;
        if self.slots.len() <= slot {
            if self.slots.capacity() <= slot {
                // Doubling would waste a quarter of the memory of a large world on average.
                self.slots.reserve_exact(slot + 1 - self.slots.len() + slot / 8 + 4);
            }
            self.slots.resize_with(slot + 1, || None);
        }
        self.slots[slot] = Some((key, value));
        key
    }

    /// Another value for each.
    pub fn map<U>(&self, to: impl Fn(&T) -> U) -> SlotTable<K, U> {
        let slots = self.slots.iter().map(|slot| slot.as_ref().map(|(key, value)| (*key, to(value)))).collect();
        SlotTable { keys: self.keys.clone(), slots }
    }

    pub fn remove(&mut self, key: K) -> Option<T> {
        self.keys.remove(key)?;
        self.slots[slot_of(key) as usize].take().map(|(_, value)| value)
    }

    /// In the order of their slots, as all iterators here.
    pub fn keys(&self) -> impl ExactSizeIterator<Item = K> {
        self.keys.keys()
    }

    pub fn values(&self) -> impl Iterator<Item = &T> {
        self.slots.iter().flatten().map(|(_, value)| value)
    }

    /// What each slot holds.
    pub fn slots_mut(&mut self) -> &mut [Option<(K, T)>] {
        &mut self.slots
    }
}

impl<K: Key, T> Index<K> for SlotTable<K, T> {
    type Output = T;

    fn index(&self, key: K) -> &T {
        self.get(key).expect("a live key")
    }
}

impl<K: Key, T> IndexMut<K> for SlotTable<K, T> {
    fn index_mut(&mut self, key: K) -> &mut T {
        self.get_mut(key).expect("a live key")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::keys::InstanceKey;

    #[test]
    fn a_map_of_instances_does_what_a_slot_map_does() {
        let (mut map, mut expected) = (SlotTable::default(), SlotMap::<InstanceKey, usize>::with_key());
        let mut keys = vec![InstanceKey::default()];
        for step in 0..3000_usize {
            let key = keys[step * 31 % keys.len()];
            if step * 17 % 5 < 3 {
                keys.push(map.insert(step));
                assert_eq!(expected.insert(step), keys[keys.len() - 1]);
            } else {
                // Stale keys too, some of whose slots have a new occupant.
                assert_eq!(map.remove(key), expected.remove(key));
            }
            if let Some(value) = map.get_mut(key) {
                *value += 1;
                expected[key] += 1;
            }
            assert_eq!((map.get(key), map.contains_key(key)), (expected.get(key), expected.contains_key(key)));
            assert_eq!(map.key_at(slot_of(key)).is_some_and(|live| live == key), expected.contains_key(key));
            assert_eq!(map.len(), expected.len());
        }
        assert!(map.keys().eq(expected.keys()) && map.values().eq(expected.values()));
        assert!(map.slot_count() < expected.capacity() + 2);
    }
}

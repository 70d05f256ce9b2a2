//! The instances of a world by key.

use std::ops::{Index, IndexMut};

use slotmap::SlotMap;

use crate::keys::{InstanceKey, slot_of};

/// A map as `SlotMap<InstanceKey, T>`, whose values lie in a list that threads can divide.
pub(super) struct InstanceMap<T> {
    keys: SlotMap<InstanceKey, ()>,
    /// The live instance of each slot that is or was in use, with its key.
    slots: Vec<Option<(InstanceKey, T)>>,
}

impl<T> Default for InstanceMap<T> {
    fn default() -> Self {
        Self { keys: SlotMap::with_key(), slots: Vec::new() }
    }
}

impl<T> InstanceMap<T> {
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// The number of slots that are or were in use.
    pub fn slot_count(&self) -> usize {
        self.slots.len()
    }

    /// The number of slots that the list has room for.
    pub fn capacity(&self) -> usize {
        self.slots.capacity()
    }

    /// The number of keys that the map has room for.
    pub fn key_capacity(&self) -> usize {
        self.keys.capacity()
    }

    pub fn contains_key(&self, key: InstanceKey) -> bool {
        self.keys.contains_key(key)
    }

    /// The key of the live instance in a slot.
    pub fn key_at(&self, slot: u32) -> Option<InstanceKey> {
        self.slots.get(slot as usize)?.as_ref().map(|(key, _)| *key)
    }

    pub fn get(&self, key: InstanceKey) -> Option<&T> {
        let (live, instance) = self.slots.get(slot_of(key) as usize)?.as_ref()?;
        (*live == key).then_some(instance)
    }

    pub fn get_mut(&mut self, key: InstanceKey) -> Option<&mut T> {
        let (live, instance) = self.slots.get_mut(slot_of(key) as usize)?.as_mut()?;
        (*live == key).then_some(instance)
    }

    pub fn insert(&mut self, instance: T) -> InstanceKey {
        let key = self.keys.insert(());
        let slot = slot_of(key) as usize;
        if self.slots.len() <= slot {
            self.slots.resize_with(slot + 1, || None);
        }
        self.slots[slot] = Some((key, instance));
        key
    }

    pub fn remove(&mut self, key: InstanceKey) -> Option<T> {
        self.keys.remove(key)?;
        self.slots[slot_of(key) as usize].take().map(|(_, instance)| instance)
    }

    /// In the order of their slots, as all iterators here.
    pub fn keys(&self) -> impl Iterator<Item = InstanceKey> {
        self.slots.iter().flatten().map(|(key, _)| *key)
    }

    pub fn values(&self) -> impl Iterator<Item = &T> {
        self.slots.iter().flatten().map(|(_, instance)| instance)
    }

    pub fn values_mut(&mut self) -> impl Iterator<Item = &mut T> {
        self.slots.iter_mut().flatten().map(|(_, instance)| instance)
    }

    /// What each slot holds.
    #[cfg(feature = "parallel")]
    pub fn slots_mut(&mut self) -> &mut [Option<(InstanceKey, T)>] {
        &mut self.slots
    }
}

impl<T> Index<InstanceKey> for InstanceMap<T> {
    type Output = T;

    fn index(&self, key: InstanceKey) -> &T {
        self.get(key).expect("a live instance")
    }
}

impl<T> IndexMut<InstanceKey> for InstanceMap<T> {
    fn index_mut(&mut self, key: InstanceKey) -> &mut T {
        self.get_mut(key).expect("a live instance")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_of_instances_does_what_a_slot_map_does() {
        let (mut map, mut expected) = (InstanceMap::default(), SlotMap::<InstanceKey, usize>::with_key());
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

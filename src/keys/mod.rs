//! Keys of trees, instances, directional lights and regions, their conversion to and from `u64`, and the
//! names of lights.

pub(crate) mod linked_lists;

use slotmap::{Key, KeyData, new_key_type};

new_key_type! {
    /// Identifies a light tree of a [`LightWorld`](crate::LightWorld).
    ///
    /// The key of a removed tree is *stale*: calls refuse it. A key repeats only after its slot has
    /// been reused 2³¹ times.
    ///
    /// # As a number
    /// A key converts to a `u64` and back, for engines that keep handles in C or in files of one
    /// session. The number is never 0. A number that belongs to no key is refused like a stale
    /// key, so a forged number does no harm. A number that equals that of a live key identifies the
    /// same object as the key.
    ///
    /// ```
    /// use girandole::{LightTree, LightWorld, TreeKey};
    /// let mut world = LightWorld::new();
    /// let key = world.add_tree(LightTree::new(Vec::new())?);
    /// let handle = u64::from(key);
    /// assert_eq!(TreeKey::from(handle), key);
    /// assert!(world.tree(TreeKey::from(0)).is_none());
    /// # Ok::<(), girandole::WorldError>(())
    /// ```
    pub struct TreeKey;

    /// Identifies an instance of a tree. Becomes stale and converts to a number as [`TreeKey`]
    /// does.
    pub struct InstanceKey;

    /// Identifies a directional light of a world. Becomes stale and converts to a number as
    /// [`TreeKey`] does.
    pub struct DirectionalKey;

    /// Identifies a region of a world. Becomes stale and converts to a number as [`TreeKey`] does.
    pub struct RegionKey;
}

/// The name of a light that can be sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum LightId {
    /// A light of an instance's tree.
    Local {
        /// The instance.
        instance: InstanceKey,
        /// The light's index in the tree.
        light: u32,
    },
    /// A directional light of the world.
    Directional(DirectionalKey),
}

macro_rules! convert_to_and_from_u64 {
    ($($key:ident),*) => {$(
        impl From<$key> for u64 {
            fn from(key: $key) -> Self {
                key.data().as_ffi()
            }
        }

        impl From<u64> for $key {
            fn from(number: u64) -> Self {
                key_data(number).into()
            }
        }
    )*};
}

convert_to_and_from_u64!(TreeKey, InstanceKey, DirectionalKey, RegionKey);

/// The inverse of [`KeyData::as_ffi`]; the null key, which is never live, for a number that no key
/// has.
///
/// The high word holds the slot's version, which is odd while the slot is in use.
/// [`KeyData::from_ffi`] would make an even one odd, so that a bare slot number named the first
/// occupant of that slot.
fn key_data(number: u64) -> KeyData {
    let is_of_a_key = (number >> 32) & 1 == 1;
    if is_of_a_key { KeyData::from_ffi(number) } else { KeyData::default() }
}

/// The slot number of a key: small, dense, and reused by a later key once this one is removed.
pub(crate) fn slot_of(key: impl Key) -> u32 {
    (key.data().as_ffi() & 0xffff_ffff) as u32
}

#[cfg(test)]
mod tests {
    use slotmap::SlotMap;

    use super::*;

    #[test]
    fn a_key_becomes_a_number_and_back() {
        let mut map = SlotMap::<InstanceKey, ()>::with_key();
        for _ in 0..100 {
            let (kept, removed) = (map.insert(()), map.insert(()));
            map.remove(removed);
            for key in [kept, removed] {
                let number = u64::from(key);
                assert_ne!(number, 0);
                assert_eq!(number as u32, slot_of(key));
                assert_eq!(InstanceKey::from(number), key);
            }
        }
        assert_eq!(TreeKey::from(u64::from(TreeKey::null())), TreeKey::null());
    }

    #[test]
    fn a_number_that_no_key_has_names_nothing() {
        let mut map = SlotMap::<DirectionalKey, ()>::with_key();
        let key = map.insert(());
        let slot = u64::from(slot_of(key));
        assert!(map.contains_key(DirectionalKey::from(u64::from(key))));
        for forged in [0, slot, slot | 2 << 32, slot | 3 << 32, u64::from(key) + 1, u64::MAX, 1 << 32] {
            assert!(!map.contains_key(DirectionalKey::from(forged)), "{forged:#x}");
        }
        map.remove(key);
        assert!(!map.contains_key(DirectionalKey::from(u64::from(key))), "stale");
    }
}

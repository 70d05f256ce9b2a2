//! The names of what a world holds.

use slotmap::{Key, new_key_type};

new_key_type! {
    /// Names a light tree of a world; never reused.
    pub struct TreeKey;
    /// Names an instance of a tree; never reused.
    pub struct InstanceKey;
    /// Names a directional light of a world; never reused.
    pub struct DirectionalKey;
}

/// Slot numbers of keys: small, dense, and reused by a later key once theirs is removed.
pub(crate) fn slot_of(key: impl Key) -> u32 {
    (key.data().as_ffi() & 0xffff_ffff) as u32
}

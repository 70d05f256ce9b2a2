//! The name of a part of an instance.

use crate::math::dice::hash;

/// The slot of an instance, and the number of a part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct PartId {
    pub slot: u32,
    pub index: u32,
}

impl PartId {
    /// A number by which parts at one point are divided. Twin of `top_identity` in `shaders/top_keys.wgsl`.
    pub fn identity(self) -> u32 {
        hash(hash(self.slot).wrapping_add(self.index))
    }
}

//! The record of a wide node: eight children in 208 bytes, and the links between nodes.
//!
//! The CPU samples from these bytes. `pack.rs` encodes clusters into a node and decodes them. The GPU
//! receives the same values in another order (`plan/node_record.rs`), and `shaders/node.wgsl` decodes
//! them there.

use bytemuck::{Pod, Zeroable};

/// The largest number of children of a node. Eight fill a vector register; `docs/decisions.md`
/// compares the noise of 8, 16 and 32.
pub const WIDTH: usize = 8;

/// This bit is set in [`Node::children`] if the child is one light (in a top level, one part of an
/// instance).
pub const LEAF: u32 = 1 << 31;

/// The largest number of lights in a tree: the number that 31 bits can index beside the leaf bit.
pub const MAX_LIGHTS: usize = (LEAF - 1) as usize;

/// The entry of an unused slot in [`Node::children`].
pub const EMPTY_SLOT: u32 = u32::MAX;

/// The place of the leaf of a light that was removed: see
/// [`LightTree::leaves`](crate::LightTree::leaves).
pub const NO_LEAF: u32 = u32::MAX;

/// [`Node::parent`] of the root.
pub const NO_PARENT: u32 = u32::MAX;

/// One byte for each child of a node.
pub type Bytes = [u8; WIDTH];

/// A node: up to eight children and a link to the parent. It has 208 bytes: 23 for each child and
/// 24 of its own. Tools that look into trees need it; engines do not. Any release may change it.
///
/// A dark child has the values of a child without a cone and without a range.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Node {
    /// Least corner of the box around all children, in metres.
    pub origin: [f32; 3],
    /// Four bytes, the lowest first: the biased exponents of the grid's steps along x, y and z,
    /// which are powers of two; then the number of children in the lower half, and in the upper one
    /// a whole number s from −8 to 7 for `area_ratios`.
    pub steps: u32,
    /// For each child the index of its node; or [`LEAF`] with the index of its light; or
    /// [`EMPTY_SLOT`].
    pub children: [u32; WIDTH],
    /// Lumens, as the upper half of an f32. 0 if all lights below are dark.
    pub flux: [u16; WIDTH],
    /// Least corner of the child's box, in steps from `origin`, rounded down.
    pub low: [Bytes; 3],
    /// Greatest corner of the child's box, in steps from `origin`, rounded up.
    pub high: [Bytes; 3],
    /// Mean position, weighted by flux: shares of 1/255 of the way from the least to the greatest
    /// corner.
    pub mean: [Bytes; 3],
    /// Standard deviation of position, in shares of 1/255 of half the box's diagonal.
    pub deviation: Bytes,
    /// `parent node * WIDTH + slot`, or [`NO_PARENT`].
    pub parent: u32,
    /// Four bits for each child, the lowest first: how its flux is divided between surfaces and
    /// lights without size. 0 is without surfaces, 15 is surfaces alone, and k in between a ratio
    /// of 2^(k − 7 − 3s): areas change by a factor of about 2^3s in the instance that the tree was
    /// built for. 0 in a top level.
    pub area_ratios: u32,
    /// √(1 − length) of the mean direction of emission, in steps of 1/255.
    pub shortness: Bytes,
    /// Direction of the mean direction of emission: three signed coordinates in steps of 1/127, not
    /// of unit length.
    pub axis: [[i8; WIDTH]; 3],
    /// 1 minus the cosine of the half-angle of the cap of emission about `axis`, in steps of 1/127,
    /// rounded up. From 254 on the cap is all directions.
    pub cap: Bytes,
    /// The largest range in metres, as the upper half of an f32, rounded up.
    pub range: [u16; WIDTH],
}

/// The kind and the index of a child.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ChildRef {
    /// The index of a node.
    Node(u32),
    /// The index of a light; in a top level, the bits that name a part of an instance.
    Leaf(u32),
}

impl ChildRef {
    /// Decodes an entry of [`Node::children`]. `None` for an unused slot.
    pub fn of(bits: u32) -> Option<Self> {
        match bits {
            EMPTY_SLOT => None,
            t if t & LEAF != 0 => Some(Self::Leaf(t & !LEAF)),
            t => Some(Self::Node(t)),
        }
    }
}

impl Node {
    /// The number of children. They have the first slots.
    pub fn count(&self) -> usize {
        (self.steps >> 24 & 15) as usize
    }

    /// Sets the number of children.
    pub(super) fn set_count(&mut self, count: usize) {
        self.steps = self.steps & 0xf0ff_ffff | (count as u32) << 24;
    }

    /// The child in a slot. `None` for an unused slot and for a slot outside the node (from
    /// [`WIDTH`] on).
    pub fn child(&self, slot: usize) -> Option<ChildRef> {
        self.children.get(slot).and_then(|bits| ChildRef::of(*bits))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slot_that_is_unused_or_outside_the_node_has_no_child() {
        let mut node = Node { children: [EMPTY_SLOT; WIDTH], ..Node::zeroed() };
        (node.children[0], node.children[7]) = (5, LEAF | 6);
        assert_eq!((node.child(0), node.child(7)), (Some(ChildRef::Node(5)), Some(ChildRef::Leaf(6))));
        assert!([1, WIDTH, WIDTH + 1, usize::MAX].into_iter().all(|slot| node.child(slot).is_none()));
    }

    #[test]
    fn the_largest_light_index_with_the_leaf_bit_differs_from_the_mark_of_an_empty_slot() {
        assert_ne!((MAX_LIGHTS - 1) as u32 | LEAF, EMPTY_SLOT);
    }
}

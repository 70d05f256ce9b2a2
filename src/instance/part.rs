//! The parts of instances, which are the leaves of the top level.

use crate::tree::{ChildRef, LEAF};

/// This bit is set in the child bits of a leaf whose other bits name a [`Part`]; without it they
/// name the slot of an instance that is a leaf as a whole.
pub(crate) const PART: u32 = 1 << 30;

/// This bit is set in the child bits of a leaf that is a single light.
pub(crate) const SINGLE: u32 = 1 << 29;

/// The child bits of a leaf that hold the number of a part or the slot of an instance.
pub(crate) const PART_BITS: u32 = SINGLE - 1;

/// A part of an instance: all of its tree, or what lies below one of the tree's openings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Part {
    /// The slot of the instance.
    pub slot: u32,
    /// Where a walk goes on in the tree: the root, or the node or the light that is an opening.
    pub entry: ChildRef,
}

impl Part {
    /// The child bits of the leaf that is this part, the one with number `index`.
    pub fn leaf(&self, index: u32) -> u32 {
        match self.entry {
            ChildRef::Node(0) => LEAF | self.slot,
            ChildRef::Node(_) => LEAF | PART | index,
            ChildRef::Leaf(_) => LEAF | PART | SINGLE | index,
        }
    }
}

//! The nodes of the geometry's hierarchies, in the layout that both backends read.
//!
//! A node holds the boxes of both its children, as in Aila and Laine (HPG 2009): one read of 64
//! bytes decides about two boxes.

use bytemuck::{Pod, Zeroable};
use girandole::glam::Vec3;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

/// The bit that marks a reference to a leaf. Bits 28 to 30 then hold the number of triangles minus
/// one, and the lower bits the first triangle or the object.
pub const LEAF: u32 = 1 << 31;
/// Position of a leaf's count.
pub const COUNT_SHIFT: u32 = 28;
/// Bits of a leaf's first triangle or object.
pub const FIRST_MASK: u32 = (1 << COUNT_SHIFT) - 1;
/// The most triangles, and the most objects, that references can distinguish.
pub const MAX_REFERENCE: usize = 1 << COUNT_SHIFT;
/// The root of a hierarchy without objects, and the mark on the stack that ends a traversal.
pub const NOTHING: u32 = u32::MAX;
/// The mark on the stack that ends the traversal of an object.
pub const LEAVE: u32 = u32::MAX - 1;

/// The boxes of two children and the references to them. `Node` in `render.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(16))]
pub struct Node {
    /// Lower corner of the first child's box.
    pub min0: Vec3,
    /// Index of a node, or a reference to a leaf.
    pub child0: u32,
    /// Upper corner.
    pub max0: Vec3,
    /// Zero.
    pub padding0: u32,
    /// Lower corner of the second child's box.
    pub min1: Vec3,
    /// Index of a node, or a reference to a leaf.
    pub child1: u32,
    /// Upper corner.
    pub max1: Vec3,
    /// Zero.
    pub padding1: u32,
}

/// A hierarchy, or the part of one below a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Subtree {
    /// Index of a node, a reference to a leaf, or [`NOTHING`].
    pub root: u32,
    /// Nodes on the longest path from the root.
    pub depth: u32,
}

impl Subtree {
    /// A hierarchy without objects.
    pub const EMPTY: Self = Self { root: NOTHING, depth: 0 };
}

/// A reference to a leaf of `count` (1 to 8) triangles, or of one object.
pub fn leaf_reference(first: u32, count: u32) -> u32 {
    debug_assert!((1..=8).contains(&count) && first <= FIRST_MASK);
    LEAF | (count - 1) << COUNT_SHIFT | first
}

/// Appends the inner nodes of a hierarchy, parents before children. `leaf` returns the reference to
/// a leaf.
pub fn collect_nodes(bvh: &Bvh2, nodes: &mut Vec<Node>, leaf: impl Fn(&Bvh2Node) -> u32) -> Subtree {
    let root = bvh.nodes[0];
    if root.is_leaf() {
        return Subtree { root: leaf(&root), depth: 1 };
    }
    let first = nodes.len();
    let mut depth = 0;
    // (first of two children in the source, place of the reference to them, depth)
    let mut stack = vec![(root.first_index as usize, usize::MAX, 1u32)];
    while let Some((pair, slot, level)) = stack.pop() {
        let index = nodes.len();
        if slot != usize::MAX {
            let parent = &mut nodes[slot / 2];
            *(if slot.is_multiple_of(2) { &mut parent.child0 } else { &mut parent.child1 }) = index as u32;
        }
        depth = depth.max(level);
        let [a, b] = [bvh.nodes[pair], bvh.nodes[pair + 1]];
        let mut references = [0; 2];
        for (side, child) in [&a, &b].into_iter().enumerate() {
            if child.is_leaf() {
                references[side] = leaf(child);
            } else {
                stack.push((child.first_index as usize, index * 2 + side, level + 1));
            }
        }
        nodes.push(Node {
            min0: a.aabb().min.into(),
            child0: references[0],
            max0: a.aabb().max.into(),
            padding0: 0,
            min1: b.aabb().min.into(),
            child1: references[1],
            max1: b.aabb().max.into(),
            padding1: 0,
        });
    }
    Subtree { root: first as u32, depth: depth + 1 }
}

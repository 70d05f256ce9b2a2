//! The shape of a tree: which lights and nodes are the children of which node.
//!
//! Based on CK18 4.2-4.4. Differs: the binary splits are collected into wide nodes (`children.rs`).

mod bins;
mod children;
mod costed;
mod counts;
mod group;
mod median;
mod planes;
mod shaping;
mod sides;
mod split;
#[cfg(test)]
mod tests;

pub(crate) use group::BuildItem;
#[cfg(feature = "gpu-plan")]
pub(crate) use planes::BY_IDENTITY;
pub(crate) use planes::{EXIT, Planes, divide};
pub(super) use shaping::Shaping;

use super::node::WIDTH;

/// One node of a shape. Nodes are stored depth first: a parent before its children, and every
/// subtree contiguous.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ShapeNode {
    /// [`LEAF`](super::LEAF) with an item's index, or a node's index.
    /// [`EMPTY_SLOT`](super::EMPTY_SLOT) from `count` on.
    pub(crate) children: [u32; WIDTH],
    pub(crate) count: u32,
    /// `node * WIDTH + slot`, or [`NO_PARENT`](super::NO_PARENT).
    pub(super) parent: u32,
}

/// Shapes a tree over some items and sorts them into the order of its leaves. The result does not
/// depend on the number of threads. O(n log n).
pub(crate) fn shape(items: &mut [BuildItem]) -> Vec<ShapeNode> {
    let mut shaping = Shaping::default();
    if !items.is_empty() {
        shaping.reserve(items.len());
        shaping.sum(items, usize::MAX);
        shaping.start();
        shaping.finish(items);
    }
    shaping.nodes
}

/// Slightly more nodes than most shapes need: nodes usually hold 5.5 to 6 lights.
fn likely_nodes(items: usize) -> usize {
    items / 5 + 1
}

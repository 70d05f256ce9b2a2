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
mod sides;
mod split;
mod stepped;
mod stepped_split;
#[cfg(test)]
mod tests;

use children::ChildChooser;
use children::Children;
use costed::CostedGroup;
pub(crate) use group::BuildItem;
#[cfg(feature = "gpu-plan")]
pub(crate) use planes::BY_IDENTITY;
pub(crate) use planes::{EXIT, Planes, divide};
pub(super) use stepped::SteppedShape;

use super::node::{EMPTY_SLOT, LEAF, NO_PARENT, WIDTH};
use group::Group;
use split::split;

/// Subtrees of fewer lights are built on one thread.
#[cfg(feature = "parallel")]
const PARALLEL_ITEMS: usize = 4096;

/// Nodes at this depth and below are split into halves. So no tree is deeper than this plus the
/// bits of its number of lights. A million lights make 8 or 9 levels; at geometric distances from
/// 1e-9 m to 1e9 m they make 16.
const MAX_COST_DEPTH: u32 = 32;

/// One node of a shape. Nodes are stored depth first: a parent before its children, and every
/// subtree contiguous.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ShapeNode {
    /// [`LEAF`] with an item's index, or a node's index. [`EMPTY_SLOT`] from `count` on.
    pub(crate) children: [u32; WIDTH],
    pub(crate) count: u32,
    /// `node * WIDTH + slot`, or [`NO_PARENT`].
    pub(super) parent: u32,
    /// The number of nodes in its subtree, itself included.
    pub(super) span: u32,
}

impl ShapeNode {
    const EMPTY: Self = Self { children: [EMPTY_SLOT; WIDTH], count: 0, parent: NO_PARENT, span: 1 };

    fn push(&mut self, child: u32) {
        self.children[self.count as usize] = child;
        self.count += 1;
    }

    fn push_leaves(&mut self, items: &[BuildItem]) {
        items.iter().for_each(|item| self.push(LEAF | item.index()));
    }
}

/// The shape of a whole tree.
pub(crate) struct TreeShape {
    pub nodes: Vec<ShapeNode>,
    /// The number of sides, which are the children of the root; 0 for a tree that is not divided.
    pub sides: usize,
}

/// Shapes the tree of an object: divides it into sides, if its lights disagree in direction, and
/// each side as [`shape()`] does. O(n log n).
pub(crate) fn shape_tree(items: &mut [BuildItem]) -> TreeShape {
    let Some(children) = sides::sides(items) else { return TreeShape { nodes: shape(items), sides: 0 } };
    let mut nodes = Vec::with_capacity(likely_nodes(items.len()));
    nodes.push(ShapeNode::EMPTY);
    shape_children(items, &children, 0, 0, &mut nodes);
    link(&mut nodes);
    TreeShape { nodes, sides: children.len() }
}

/// Shapes a tree over some items and sorts them into the order of its leaves. The result does not
/// depend on the number of threads. O(n log n).
pub(crate) fn shape(items: &mut [BuildItem]) -> Vec<ShapeNode> {
    let mut nodes = Vec::with_capacity(likely_nodes(items.len()));
    if !items.is_empty() {
        let whole = Group::around(items);
        shape_below(items, &whole, 0, &mut nodes);
    }
    link(&mut nodes);
    nodes
}

/// Slightly more nodes than most shapes need: nodes usually hold 5.5 to 6 lights.
fn likely_nodes(items: usize) -> usize {
    items / 5 + 1
}

/// Turns distances to child nodes into indices, and links the children to their parents.
fn link(nodes: &mut [ShapeNode]) {
    (0..nodes.len()).for_each(|node| link_children(nodes, node));
}

/// [`link`] for the children of one node.
#[inline(always)]
fn link_children(nodes: &mut [ShapeNode], node: usize) {
    for slot in 0..nodes[node].count as usize {
        let child = nodes[node].children[slot];
        if child & LEAF == 0 {
            let child = node + child as usize;
            nodes[node].children[slot] = child as u32;
            nodes[child].parent = (node * WIDTH + slot) as u32;
        }
    }
}

/// Appends a subtree. Its nodes name their child nodes by distance, so it can be appended to any
/// list.
fn shape_below(items: &mut [BuildItem], whole: &Group, depth: u32, nodes: &mut Vec<ShapeNode>) {
    let own = nodes.len();
    nodes.push(ShapeNode::EMPTY);
    if items.len() <= WIDTH {
        nodes[own].push_leaves(items);
        return;
    }
    let children = choose_children(items, whole, depth >= MAX_COST_DEPTH);
    shape_children(items, &children, own, depth, nodes);
}

/// Appends the subtrees of the node `own`, which is the last of `nodes` and still empty, and names
/// them as its children.
fn shape_children(
    items: &mut [BuildItem],
    children: &Children<CostedGroup>,
    own: usize,
    depth: u32,
    nodes: &mut Vec<ShapeNode>,
) {
    let mut node = ShapeNode::EMPTY;
    #[cfg(feature = "parallel")]
    let count = items.len();
    let mut subtrees = Subtrees::default();
    let mut rest = items;
    for (child, is_inlined) in children.iter() {
        let (items, others) = rest.split_at_mut(child.group.count);
        rest = others;
        if is_inlined || items.len() == 1 {
            node.push_leaves(items);
        } else {
            let slot = node.count as usize;
            subtrees[slot] = Some((slot, items, &child.group));
            node.push(EMPTY_SLOT);
        }
    }
    #[cfg(feature = "parallel")]
    if count >= PARALLEL_ITEMS {
        for (slot, subtree) in shape_in_parallel(std::mem::take(&mut subtrees), depth + 1) {
            node.children[slot] = (nodes.len() - own) as u32;
            nodes.extend(subtree);
        }
    }
    for (slot, items, group) in subtrees.into_iter().flatten() {
        node.children[slot] = (nodes.len() - own) as u32;
        shape_below(items, group, depth + 1, nodes);
    }
    node.span = (nodes.len() - own) as u32;
    nodes[own] = node;
}

/// The slots whose child is a node that still has to be shaped, with the items of its subtree.
type Subtrees<'a> = [Option<(usize, &'a mut [BuildItem], &'a Group)>; WIDTH];

/// Shapes subtrees on rayon's threads. Returns them in the order of their slots.
#[cfg(feature = "parallel")]
fn shape_in_parallel(subtrees: Subtrees<'_>, depth: u32) -> Vec<(usize, Vec<ShapeNode>)> {
    use rayon::prelude::*;
    let shape_one = |(slot, items, group): (usize, &mut [BuildItem], &Group)| {
        let mut nodes = Vec::with_capacity(likely_nodes(items.len()));
        shape_below(items, group, depth, &mut nodes);
        (slot, nodes)
    };
    subtrees.into_par_iter().flatten().map(shape_one).collect()
}

/// Divides a node's items among its children, and sorts the items accordingly. `halve` is as in
/// [`split()`].
#[inline(never)]
fn choose_children(items: &mut [BuildItem], whole: &Group, halve: bool) -> Children<CostedGroup> {
    Children::choose(CostedGroup::whole(whole), |first, CostedGroup { group, .. }| {
        Some(CostedGroup::parts(whole, &split(&mut items[first..][..group.count], group, halve)))
    })
}

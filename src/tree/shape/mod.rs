//! The shape of a tree: which lights and nodes are children of which node.
//!
//! Based on CK18 4.2-4.4. Differs: splits in two are collected into wide nodes by always splitting the costliest group
//! that one node cannot hold; groups that fit whole into the room that is left are opened. Both keep nodes full, which
//! is what a tree's memory and its refits cost.

mod bins;
mod group;
mod split;
#[cfg(test)]
mod tests;

pub(crate) use group::Item;
#[cfg(feature = "gpu")]
pub(crate) use split::{FULL, SPARSE_COUNTS};
pub(crate) use split::{fills_nodes, middle};

use super::node::{EMPTY_SLOT, LEAF, NO_PARENT, WIDTH};
use group::Group;
use split::split;

/// Nodes with fewer lights are built on one thread.
#[cfg(feature = "parallel")]
const PARALLEL_ITEMS: usize = 4096;

/// Nodes this deep are split into halves, so that no tree is deeper than this and the bits of a count. A million lights
/// make 8 or 9 levels, at geometric distances from 1e-9 to 1e9 m 16.
const DEEPEST: u32 = 32;

/// One node of a shape. Nodes lie depth first: a parent before its children, every subtree contiguous.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ShapeNode {
    /// [`LEAF`] and an item's index, or a node's; [`EMPTY_SLOT`] from `count` on.
    pub(crate) targets: [u32; WIDTH],
    pub(crate) count: u32,
    /// `node * WIDTH + slot`, or [`NO_PARENT`].
    pub(super) parent: u32,
    /// Nodes of its subtree, with itself.
    pub(super) span: u32,
}

impl ShapeNode {
    const EMPTY: Self = Self { targets: [EMPTY_SLOT; WIDTH], count: 0, parent: NO_PARENT, span: 1 };

    fn push(&mut self, target: u32) {
        self.targets[self.count as usize] = target;
        self.count += 1;
    }
}

/// Shapes a tree and puts the items into the order of its leaves. The same for any number of threads.
pub(crate) fn shape(items: &mut [Item]) -> Vec<ShapeNode> {
    let mut nodes = Vec::with_capacity(likely_nodes(items));
    if !items.is_empty() {
        let whole = Group::around(items);
        shape_below(items, &whole, 0, &mut nodes);
    }
    link(&mut nodes);
    nodes
}

/// A little more than the nodes of 5.5 to 6 lights that are the rule.
fn likely_nodes(items: &[Item]) -> usize {
    items.len() / 5 + 1
}

/// Makes distances to child nodes indices, and tells them their parents.
fn link(nodes: &mut [ShapeNode]) {
    for node in 0..nodes.len() {
        for slot in 0..nodes[node].count as usize {
            let target = nodes[node].targets[slot];
            if target & LEAF == 0 {
                let child = node + target as usize;
                nodes[node].targets[slot] = child as u32;
                nodes[child].parent = (node * WIDTH + slot) as u32;
            }
        }
    }
}

/// Appends a subtree. Its nodes name their child nodes by the distance, so that it can be appended anywhere.
fn shape_below(items: &mut [Item], whole: &Group, depth: u32, nodes: &mut Vec<ShapeNode>) {
    let own = nodes.len();
    let mut node = ShapeNode::EMPTY;
    nodes.push(node);
    if items.len() <= WIDTH {
        items.iter().for_each(|item| node.push(LEAF | item.index()));
        nodes[own] = node;
        return;
    }
    let groups = Groups::of(items, whole, depth >= DEEPEST);
    let mut children = Children::default();
    let mut rest = items;
    for (group, is_open) in groups.groups[..groups.count].iter().zip(groups.is_open) {
        let (items, behind) = rest.split_at_mut(group.count);
        rest = behind;
        if is_open || items.len() == 1 {
            items.iter().for_each(|item| node.push(LEAF | item.index()));
        } else {
            let slot = node.count as usize;
            children[slot] = Some((slot, items, group));
            node.push(EMPTY_SLOT);
        }
    }
    #[cfg(feature = "parallel")]
    if whole.count >= PARALLEL_ITEMS {
        for (slot, subtree) in shape_apart(std::mem::take(&mut children), depth + 1) {
            node.targets[slot] = (nodes.len() - own) as u32;
            nodes.extend(subtree);
        }
    }
    for (slot, items, group) in children.into_iter().flatten() {
        node.targets[slot] = (nodes.len() - own) as u32;
        shape_below(items, group, depth + 1, nodes);
    }
    node.span = (nodes.len() - own) as u32;
    nodes[own] = node;
}

/// Child nodes to be: slots and what lies below.
type Children<'a> = [Option<(usize, &'a mut [Item], &'a Group)>; WIDTH];

/// Shapes subtrees on rayon's threads, for their slots.
#[cfg(feature = "parallel")]
fn shape_apart(children: Children<'_>, depth: u32) -> Vec<(usize, Vec<ShapeNode>)> {
    use rayon::prelude::*;
    let apart = |(slot, items, group): (usize, &mut [Item], &Group)| {
        let mut nodes = Vec::with_capacity(likely_nodes(items));
        shape_below(items, group, depth, &mut nodes);
        (slot, nodes)
    };
    children.into_par_iter().flatten().map(apart).collect()
}

/// What a node's items are split into, in their order.
struct Groups {
    groups: [Group; WIDTH],
    is_open: [bool; WIDTH],
    count: usize,
}

impl Groups {
    #[inline(never)]
    fn of(items: &mut [Item], whole: &Group, halve: bool) -> Self {
        let mut groups = [Group::EMPTY; WIDTH];
        groups[0] = *whole;
        let mut costs = [0.0; WIDTH];
        let mut count = 1;
        while count < WIDTH {
            // The costliest group that no node can hold; the largest, then the first of equals.
            let mut costliest: Option<usize> = None;
            for i in 0..count {
                let is_more = |best: usize| (costs[i], groups[i].count) > (costs[best], groups[best].count);
                if groups[i].count > WIDTH && costliest.is_none_or(is_more) {
                    costliest = Some(i);
                }
            }
            let Some(place) = costliest else { break };
            let first: usize = groups[..place].iter().map(|group| group.count).sum();
            let group = groups[place];
            let parts = split(&mut items[first..][..group.count], &group, halve);
            groups.copy_within(place + 1..count, place + 2);
            costs.copy_within(place + 1..count, place + 2);
            groups[place..place + 2].copy_from_slice(&parts);
            costs[place..place + 2].copy_from_slice(&whole.costs([&parts[0], &parts[1]]));
            count += 1;
        }
        let mut is_open = [false; WIDTH];
        let mut room = WIDTH - count;
        // The smallest first, as it takes the least room; the first of equals.
        while let Some(place) =
            (0..count).filter(|i| groups[*i].count > 1 && !is_open[*i]).min_by_key(|i| groups[*i].count)
            && groups[place].count - 1 <= room
        {
            is_open[place] = true;
            room -= groups[place].count - 1;
        }
        Self { groups, is_open, count }
    }
}

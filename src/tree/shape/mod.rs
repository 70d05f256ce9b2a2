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

pub(super) use group::Item;

use super::node::{EMPTY_SLOT, LEAF, NO_PARENT, WIDTH};
use group::Group;
use split::split;

/// Nodes with fewer lights are built on one thread.
#[cfg(feature = "parallel")]
const PARALLEL_ITEMS: usize = 4096;

/// Nodes this deep are split into halves, which bounds the depth of any tree by 32 and the bits of a count. A million
/// lights need 7 levels at least and 9 as a rule; deeper than this only gets what shrinks geometrically.
const DEEPEST: u32 = 32;

/// One node of a shape. Nodes lie depth first: a parent before its children, every subtree contiguous.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ShapeNode {
    /// [`LEAF`] and an item's index, or a node's; [`EMPTY_SLOT`] from `count` on.
    pub(super) targets: [u32; WIDTH],
    pub(super) count: u32,
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
pub(super) fn shape(items: &mut [Item]) -> Vec<ShapeNode> {
    // 5.8 lights a node as a rule.
    let mut nodes = Vec::with_capacity(items.len() / 5 + 1);
    if !items.is_empty() {
        let whole = Group::around(items);
        shape_below(items, &whole, 0, &mut nodes);
    }
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
    nodes
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
    let mut children: [Option<(u32, &mut [Item], &Group)>; WIDTH] = Default::default();
    let mut rest = items;
    for (group, is_open) in groups.groups[..groups.count].iter().zip(groups.is_open) {
        let (items, behind) = rest.split_at_mut(group.count);
        rest = behind;
        if is_open || items.len() == 1 {
            items.iter().for_each(|item| node.push(LEAF | item.index()));
        } else {
            children[node.count as usize] = Some((node.count, items, group));
            node.push(EMPTY_SLOT);
        }
    }
    #[cfg(feature = "parallel")]
    if whole.count >= PARALLEL_ITEMS {
        use rayon::prelude::*;
        let subtrees: Vec<(u32, Vec<ShapeNode>)> = children
            .into_par_iter()
            .flatten()
            .map(|(slot, items, group)| {
                let mut nodes = Vec::with_capacity(items.len() / 5 + 1);
                shape_below(items, group, depth + 1, &mut nodes);
                (slot, nodes)
            })
            .collect();
        for (slot, subtree) in subtrees {
            node.targets[slot as usize] = (nodes.len() - own) as u32;
            nodes.extend(subtree);
        }
        node.span = (nodes.len() - own) as u32;
        nodes[own] = node;
        return;
    }
    for (slot, items, group) in children.into_iter().flatten() {
        node.targets[slot as usize] = (nodes.len() - own) as u32;
        shape_below(items, group, depth + 1, nodes);
    }
    node.span = (nodes.len() - own) as u32;
    nodes[own] = node;
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

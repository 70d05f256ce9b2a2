//! Puts nodes that edits have scattered in order again.

use super::LightTree;
use super::edited::Edited;
use super::node::{ChildRef, LEAF, NO_LEAF, NO_PARENT, WIDTH};
use super::state::TreeState;

impl LightTree {
    /// The frozen tree with the same nodes depth first and no spare ones. Every light keeps its probability.
    /// O(nodes + lights).
    pub(super) fn ordered(&self) -> Self {
        let mut numbers = vec![u32::MAX; self.nodes.len()];
        let mut order = Vec::with_capacity(self.nodes.len());
        let mut below: Vec<u32> = if self.light_count() > 0 { vec![0] } else { Vec::new() };
        while let Some(node) = below.pop() {
            numbers[node as usize] = order.len() as u32;
            order.push(node as usize);
            let record = &self.nodes[node as usize];
            below.extend((0..record.count()).rev().filter_map(|slot| match record.child(slot) {
                Some(ChildRef::Node(child)) => Some(child),
                _ => None,
            }));
        }
        let width = WIDTH as u32;
        let moved = |place: u32| numbers[(place / width) as usize] * width + place % width;
        let mut nodes: Vec<_> = order.iter().map(|node| self.nodes[*node]).collect();
        for node in &mut nodes {
            let count = node.count();
            let inner = node.children[..count].iter_mut().filter(|child| **child & LEAF == 0);
            inner.for_each(|child| *child = numbers[*child as usize]);
            if node.parent != NO_PARENT {
                node.parent = moved(node.parent);
            }
        }
        let leaf = |place: &u32| if *place == NO_LEAF { NO_LEAF } else { moved(*place) };
        Self {
            leaves: self.leaves.iter().map(leaf).collect(),
            light_counts: order.iter().map(|node| self.light_counts[*node]).collect(),
            nodes,
            state: if self.light_count() > 0 { TreeState::Frozen } else { TreeState::default() },
            edited: Edited::of_build(self.vacant_indices().clone()),
            ..self.clone()
        }
    }
}

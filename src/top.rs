//! The top level: one tree over all instances, made anew whenever one of them moved.
//!
//! Twin of the stages in `gpu/top.rs`, which builds the same tree on the GPU; a test there compares them. Instances are
//! sorted along a curve through space and every eight neighbours become a node, every eight nodes the next. Based on
//! linear BVHs (Lauterbach et al. 2009). Differs: nodes are eight wide and implicit, so every level is one pass without
//! pointers; the curve is Hilbert's, since eight neighbours along Morton's often lie far apart (docs/decisions.md).

use glam::Vec3;

use crate::bounds::Aabb;
use crate::curve::{Curve, NO_KEY};
use crate::tree::{Child, NO_PARENT, Node, WIDTH};

/// A tree over instance slots.
#[derive(Clone, Debug)]
pub(crate) struct TopLevel {
    pub nodes: Vec<Node>,
    /// For each instance slot the place (`node * WIDTH + slot`) of its leaf.
    pub places: Vec<u32>,
}

/// First node of each level, the root's first, and their number last. At least one level, for the root.
pub(crate) fn level_starts(slots: usize) -> Vec<u32> {
    let mut sizes = vec![slots.div_ceil(WIDTH).max(1) as u32];
    while let Some(&last) = sizes.last()
        && last > 1
    {
        sizes.push(last.div_ceil(WIDTH as u32));
    }
    let mut starts = vec![0];
    for size in sizes.iter().rev() {
        starts.push(starts[starts.len() - 1] + size);
    }
    starts
}

impl TopLevel {
    /// Builds over the leaves of all slots; slots without an instance hold [`Child::EMPTY`]. O(n log n).
    pub fn build(leaves: &[Child]) -> Self {
        let bounds = Aabb::around(leaves.iter().filter(|c| c.flux > 0.0).map(|c| Vec3::from(c.mean)));
        let curve = Curve::new(&bounds);
        let key = |leaf: &Child| if leaf.flux > 0.0 { curve.key(leaf.mean.into()) } else { NO_KEY };
        let mut order: Vec<(u32, u32)> = leaves.iter().zip(0..).map(|(leaf, slot)| (key(leaf), slot)).collect();
        order.sort_unstable();

        let starts = level_starts(leaves.len());
        let mut nodes = vec![Node { count: WIDTH as u32, ..Node::EMPTY }; starts[starts.len() - 1] as usize];
        let mut places = vec![0; leaves.len()];
        for (position, (_, slot)) in order.iter().enumerate() {
            let place = starts[starts.len() - 2] as usize * WIDTH + position;
            nodes[place / WIDTH].children[place % WIDTH] = leaves[*slot as usize];
            places[*slot as usize] = place as u32;
        }
        for level in (0..starts.len() - 1).rev() {
            for index in starts[level]..starts[level + 1] {
                nodes[index as usize].parent = if level == 0 {
                    NO_PARENT
                } else {
                    let place = starts[level - 1] * WIDTH as u32 + (index - starts[level]);
                    let cluster = nodes[index as usize].cluster();
                    nodes[place as usize / WIDTH].children[place as usize % WIDTH] = Child::pack(&cluster, index);
                    place
                };
            }
        }
        Self { nodes, places }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_hold_every_slot_and_end_in_one_root() {
        for (slots, starts) in [
            (0, vec![0, 1]),
            (1, vec![0, 1]),
            (8, vec![0, 1]),
            (9, vec![0, 1, 3]),
            (64, vec![0, 1, 9]),
            (65, vec![0, 1, 3, 12]),
        ] {
            assert_eq!(level_starts(slots), starts, "{slots}");
        }
    }
}

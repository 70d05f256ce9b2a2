//! The top level: one tree over all instances, made anew whenever one of them moved.
//!
//! Twin of the stages in `gpu/top.rs`, which builds the same tree on the GPU; a test there compares them. Instances are
//! sorted along a curve through space and every eight neighbours become a node, every eight nodes the next. Based on
//! linear BVHs (Lauterbach et al. 2009). Differs: nodes are eight wide and implicit, so every level is one pass without
//! pointers; the curve is Hilbert's, since eight neighbours along Morton's often lie far apart (docs/decisions.md).

use crate::bounds::Aabb;
use crate::cluster::Cluster;
use crate::curve::{Curve, NO_KEY};
use crate::tree::{EMPTY_SLOT, LEAF, NO_PARENT, Node, WIDTH, WideCluster};

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
    /// Builds over the instances of all slots; those of slots without one are dark. O(n log n).
    pub fn build(instances: &[Cluster]) -> Self {
        let bounds = Aabb::around(instances.iter().filter(|c| c.flux > 0.0).map(|c| c.mean));
        let curve = Curve::new(&bounds);
        let key = |c: &Cluster| if c.flux > 0.0 { curve.key(c.mean) } else { NO_KEY };
        let mut order: Vec<(u32, u32)> = instances.iter().zip(0..).map(|(c, slot)| (key(c), slot)).collect();
        order.sort_unstable();

        let starts = level_starts(instances.len());
        let count = starts[starts.len() - 1] as usize;
        let mut nodes = vec![Node::EMPTY; count];
        let mut wide = vec![WideCluster::EMPTY; count];
        let mut places = vec![0; instances.len()];
        for (position, (_, slot)) in order.iter().enumerate() {
            let place = starts[starts.len() - 2] as usize * WIDTH + position;
            let instance = &instances[*slot as usize];
            places[*slot as usize] = place as u32;
            if instance.flux > 0.0 {
                wide[place / WIDTH].set(place % WIDTH, instance);
                nodes[place / WIDTH].targets[place % WIDTH] = LEAF | slot;
            }
        }
        for level in (0..starts.len() - 1).rev() {
            for index in starts[level]..starts[level + 1] {
                let cluster = wide[index as usize].merged().cluster;
                nodes[index as usize].pack(&wide[index as usize], &cluster.aabb, WIDTH);
                if level > 0 {
                    let place = starts[level - 1] * WIDTH as u32 + (index - starts[level]);
                    nodes[index as usize].parent = place;
                    let (node, slot) = (place as usize / WIDTH, place as usize % WIDTH);
                    wide[node].set(slot, &cluster);
                    nodes[node].targets[slot] = if cluster.flux > 0.0 { index } else { EMPTY_SLOT };
                }
            }
        }
        debug_assert!(nodes[0].parent == NO_PARENT);
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

//! The top level: one tree over all instances, made anew whenever one of them moved.
//!
//! Twin of the stages in `gpu/top.rs`, which builds the same tree on the GPU; a test there compares them. Instances are
//! sorted along a curve through space and every eight neighbours become a node, every eight nodes the next. Based on
//! linear BVHs (Lauterbach et al. 2009). Differs: nodes are eight wide and implicit, so every level is one pass without
//! pointers; the curve halves the longest axis first, so that a flat city spends no bits on height (docs/math.md).

use glam::Vec3;

use crate::bounds::Aabb;
use crate::tree::{Child, NO_PARENT, Node, WIDTH};

/// Halvings of space in a key. One bit is left for "no instance", which sorts behind all others.
pub(crate) const KEY_BITS: u32 = 31;

/// The key of a slot without a shining instance.
pub(crate) const NO_KEY: u32 = u32::MAX;

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
        let axes = key_axes(bounds.extent());
        let key = |leaf: &Child| if leaf.flux > 0.0 { key(leaf.mean.into(), &bounds, &axes) } else { NO_KEY };
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

/// Which axis each bit of a key halves: always the one that is longest by then, x before y before z.
pub(crate) fn key_axes(extent: Vec3) -> [u8; KEY_BITS as usize] {
    let mut left = extent;
    std::array::from_fn(|_| {
        let axis = if left.x >= left.y && left.x >= left.z {
            0
        } else if left.y >= left.z {
            1
        } else {
            2
        };
        left[axis] *= 0.5;
        axis as u8
    })
}

/// The key of a position: one bit per halving. Halves and sums only, so that the GPU gets the same bits.
pub(crate) fn key(position: Vec3, bounds: &Aabb, axes: &[u8; KEY_BITS as usize]) -> u32 {
    let mut low = bounds.min;
    let mut extent = bounds.extent();
    let mut key = 0;
    for axis in axes.iter().map(|a| usize::from(*a)) {
        extent[axis] *= 0.5;
        let middle = low[axis] + extent[axis];
        let upper = position[axis] >= middle;
        if upper {
            low[axis] = middle;
        }
        key = key << 1 | u32::from(upper);
    }
    key
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

    #[test]
    fn a_flat_world_spends_its_first_bits_on_the_long_axes() {
        let axes = key_axes(Vec3::new(1000.0, 20.0, 900.0));
        assert_eq!(axes[..6], [0, 2, 0, 2, 0, 2]);
        assert!(axes.contains(&1));
        let bounds = Aabb { min: Vec3::ZERO, max: Vec3::new(1000.0, 20.0, 900.0) };
        assert_eq!(key(Vec3::ZERO, &bounds, &axes), 0);
        assert_eq!(key(bounds.max, &bounds, &axes), u32::MAX >> 1);
    }
}

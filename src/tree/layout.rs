//! Lays out the nodes of a shape in memory, with spare nodes between them.
//!
//! Later rebuilds of a subtree stay within the nodes that it already has. Their shapes may need a
//! few more nodes or fewer, which is what the spare nodes are for.

use glam::Vec3;

use super::LightTree;
use super::node::{EMPTY_SLOT, LEAF, NO_PARENT, Node, WIDTH};
use super::shape::{BuildItem, ShapeNode};
use super::tasks::RefitTasks;
use crate::cluster::{Cluster, Linear};
use crate::light::{Light, MIN_FLUX};

/// A build adds one spare node for this many nodes.
const NODES_PER_SPARE: usize = 24;

/// A light to be placed in a leaf.
#[derive(Clone, Copy)]
pub(super) struct PlacedLight {
    /// Its index in the tree.
    pub index: u32,
    pub cluster: Cluster,
}

impl PlacedLight {
    const NONE: Self = Self { index: u32::MAX, cluster: Cluster::EMPTY };

    #[inline(always)]
    pub fn new(index: usize, light: &Light) -> Self {
        Self { index: index as u32, cluster: light.cluster() }
    }
}

/// The items of a shape: the lights, named by their places in the list. `reference` is that of the
/// tree.
pub(super) fn build_items(lights: &[PlacedLight], reference: Option<&Linear>) -> Vec<BuildItem> {
    (0..).zip(lights).map(|(place, light)| build_item(&light.cluster, place, reference)).collect()
}

/// One item of a shape.
#[inline(always)]
pub(super) fn build_item(cluster: &Cluster, place: u32, reference: Option<&Linear>) -> BuildItem {
    match reference {
        Some(map) if cluster.flux > 0.0 => {
            let flux = map.flux(cluster.punctual_flux(), cluster.area_flux, cluster.axis).max(MIN_FLUX);
            BuildItem::new(&cluster.transformed(map, Vec3::ZERO, flux), place)
        }
        _ => BuildItem::new(cluster, place),
    }
}

/// The number of nodes to allocate for a shape, spare ones included.
pub(super) fn with_spare(nodes: usize) -> usize {
    nodes + nodes / NODES_PER_SPARE
}

/// The position of the node at `index` of a shape of `used` nodes among `span` nodes: the spare
/// nodes are spread evenly. `index == used` gives the end of the last subtree, which is `span`.
///
/// Strictly increasing in `index`, so a subtree stays contiguous. Exact for spans below 2^32; the
/// product needs `u64`, since it passes 2^32 from some 320,000 nodes on.
fn spread_position(index: u64, used: u64, span: u64) -> u64 {
    index + (span - used) * index / used
}

/// Where the nodes of a shape lie in a tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    /// The node of the tree that becomes the root of the shape.
    pub root: usize,
    /// The link of that node to its parent.
    pub parent: u32,
    /// The number of nodes of the shape.
    pub used: usize,
    /// The number of nodes from `root` on, spare ones included.
    pub span: usize,
}

impl Layout {
    /// The node of the tree for a node of the shape. The end of the last subtree for `used`.
    #[inline(always)]
    pub fn position(&self, index: usize) -> usize {
        self.root + spread_position(index as u64, self.used as u64, self.span as u64) as usize
    }
}

impl LightTree {
    /// Lays out a shape over some lights in the `span` empty nodes from `root` on, and refits.
    pub(super) fn lay_out(&mut self, shape: &[ShapeNode], lights: &[PlacedLight], root: usize, span: usize) {
        let layout = Layout { root, parent: self.nodes[root].parent, used: shape.len(), span };
        for i in 0..shape.len() {
            self.lay_out_node(&layout, &shape[i], i, lights);
        }
        for node in (root..root + span).rev() {
            self.count_lights(node);
        }
        self.tasks = RefitTasks::new(&self.spans);
        self.refit_subtree(root);
        self.refit();
        for node in root..root + span {
            self.built_costs[node] = self.cost_per_spread(node);
            self.edited.was_built(node, self.light_counts[node]);
        }
    }

    /// Lays out the node at index `i` of a shape and marks it for the next refit.
    #[inline(always)]
    pub(super) fn lay_out_node(&mut self, layout: &Layout, shaped: &ShapeNode, i: usize, lights: &[PlacedLight]) {
        let node = layout.position(i);
        let mut children = shaped.children;
        // Load all at once: they are anywhere in memory, and waiting for one after the other takes
        // longer than all the rest.
        let is_light = |child: u32| child != EMPTY_SLOT && child & LEAF != 0;
        let loaded: [PlacedLight; WIDTH] =
            children.map(|child| if is_light(child) { lights[(child & !LEAF) as usize] } else { PlacedLight::NONE });
        for (slot, child) in children[..shaped.count as usize].iter_mut().enumerate() {
            if *child & LEAF != 0 {
                let PlacedLight { index, cluster } = &loaded[slot];
                self.leaves[*index as usize] = (node * WIDTH + slot) as u32;
                self.wide[node].set(slot, cluster);
                *child = index | LEAF;
            } else {
                *child = layout.position(*child as usize) as u32;
            }
        }
        let parent = match shaped.parent {
            NO_PARENT => layout.parent,
            place => (layout.position(place as usize / WIDTH) * WIDTH) as u32 + place % WIDTH as u32,
        };
        self.nodes[node] = Node { children, parent, steps: shaped.count << 24, ..Node::EMPTY };
        self.spans[node] = (layout.position(i + shaped.span as usize) - node) as u32;
        self.dirty.flags_mut()[node] = true;
    }

    /// Counts the lights below a node whose child nodes have been counted.
    #[inline(always)]
    pub(super) fn count_lights(&mut self, node: usize) {
        self.light_counts[node] = self.nodes[node].children[..self.nodes[node].count()]
            .iter()
            .map(|child| if child & LEAF != 0 { 1 } else { self.light_counts[*child as usize] })
            .sum();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same in exact arithmetic.
    fn exact(index: u64, used: u64, span: u64) -> u128 {
        let [index, used, span] = [index, used, span].map(u128::from);
        index + (span - used) * index / used
    }

    #[test]
    fn positions_of_nodes_are_exact_and_increasing_at_sizes_around_and_beyond_32_bits() {
        let sizes = [1, 2, 23, 24, 25, 1000, 320_000, 321_060, 1 << 20, (1 << 29) - 1, 1 << 29, 1 << 31, (1 << 32) - 1];
        for used in sizes {
            for span in [used, used + 1, used + used / 24, 2 * used - 1].into_iter().filter(|span| *span < 1 << 32) {
                let near = |middle: u64| middle.saturating_sub(50)..=(middle + 50).min(used);
                let all = [0, used / 3, used / 2, used].map(near).into_iter().flatten();
                let mut last: Option<(u64, u64)> = None;
                for index in all.chain((0..=used).step_by(1 + used as usize / 1000)) {
                    let position = spread_position(index, used, span);
                    assert_eq!(u128::from(position), exact(index, used, span), "{index} of {used} in {span}");
                    if let Some((before, at)) = last.filter(|(before, _)| *before < index) {
                        assert!(position - at >= index - before, "{index} of {used} in {span}");
                    }
                    last = Some((index, position));
                }
                assert_eq!([0, used].map(|index| spread_position(index, used, span)), [0, span]);
            }
        }
    }
}

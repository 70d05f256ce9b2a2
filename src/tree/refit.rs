//! Refits a tree: brings its nodes up to date with lights that moved, turned or dimmed, from the
//! leaves to the root, and computes the attributes.
//!
//! A refit follows the nodes that changed upward: it goes through the set of them from the last node
//! to the first, and adds the parent of each. A parent comes before its children, so each node is
//! visited once, after all of its children.

use super::LightTree;
use super::attributes::AttributeSums;
use super::dirty::{BLOCK, WORD};
use super::node::{ChildRef, LEAF, NO_PARENT, Node, WIDTH};
use super::state::{RefitData, TreeState};
use super::wide::WideCluster;
use crate::cluster::{Cluster, Linear};
use crate::math::simd::{VectorJob, with_vectors};

/// If one in this many nodes has changed, all count as changed, and threads share the work.
const NODES_PER_LISTED: usize = 8;

/// The most pieces in which threads refit a tree. Nodes whose parents or children are in another
/// piece, some twenty of each, are left to one thread.
#[cfg(feature = "parallel")]
const PIECES: usize = 64;

impl LightTree {
    /// Updates every node above a changed light, and the attributes. The shape of the tree stays.
    ///
    /// Every cluster is recomputed from its children, so rounding does not add up over many
    /// refits. O(changed lights · depth), and at most O(nodes). Allocates nothing, except what
    /// rayon needs to share a large tree among threads, and the dropped data of a frozen tree.
    pub fn refit(&mut self) {
        if self.is_frozen() && !self.quality.is_stale {
            return;
        }
        self.thaw();
        if std::mem::take(&mut self.quality.is_stale) {
            self.mark_all();
        }
        self.refit_marked(true);
    }

    /// [`LightTree::refit`] without the attributes, for trees whose attributes are not read. They
    /// keep their values until the next [`LightTree::refit`], which then visits all nodes. The
    /// nodes have the same bits as after [`LightTree::refit`].
    pub fn refit_without_attributes(&mut self) {
        self.quality.is_stale |= self.is_dirty();
        self.refit_marked(false);
    }

    /// [`LightTree::refit`] if lights have changed since the last refit. O(1) otherwise.
    pub(crate) fn refit_changes(&mut self) {
        if self.is_dirty() {
            self.refit();
        }
    }

    /// Whether lights have changed since the last refit.
    pub(super) fn is_dirty(&self) -> bool {
        self.state.is_dirty()
    }

    /// Marks all nodes that have children.
    pub(super) fn mark_all(&mut self) {
        match &mut self.state {
            TreeState::Frozen => {}
            TreeState::Small { is_dirty, .. } => *is_dirty = !self.nodes.is_empty(),
            TreeState::Live(data) => {
                let used = self.nodes.iter().enumerate().filter(|(_, node)| node.count() > 0);
                used.for_each(|(node, _)| data.dirty.insert(node));
            }
        }
    }

    /// Refits the marked nodes and all above them, and the attributes if it `measures`.
    pub(super) fn refit_marked(&mut self, measures: bool) {
        if !self.is_dirty() {
            return;
        }
        match self.state {
            TreeState::Live(_) => self.follow_marked(measures),
            _ => self.refit_only_node(measures),
        }
    }

    /// [`LightTree::refit_marked`] for a tree that has its data for refits.
    pub(super) fn follow_marked(&mut self, measures: bool) {
        let data = self.state.data_mut();
        if data.dirty.len() >= self.nodes.len().div_ceil(NODES_PER_LISTED) {
            data.refitted.add_all();
            #[cfg(feature = "parallel")]
            self.refit_in_pieces(measures);
        }
        self.follow(self.nodes.len(), usize::MAX, measures);
        let data = self.state.data_mut();
        data.dirty.were_taken();
        (0..).zip(&mut self.sides).for_each(|(slot, side)| *side = data.wide[0].get(slot));
        if measures {
            let sums = data.attribute_sums[0];
            self.set_attributes(&sums);
        }
    }

    /// Refits up to `limit` marked nodes before `end`, behind which none is marked.
    pub(super) fn follow(&mut self, end: usize, limit: usize, measures: bool) {
        let Self { nodes, state, maps, root, .. } = self;
        let RefitData { wide, attribute_sums: sums, dirty, refitted } = state.data_mut();
        let (words, filled) = (&mut dirty.words[..], &mut dirty.filled[..]);
        let slices = NodeSlices { base: 0, nodes, wide, sums, words, filled, weights: maps.weights.as_deref() };
        let follow = Follow { slices, end, limit, measures, visit: |node| refitted.add(node) };
        *root = with_vectors(follow).unwrap_or(*root);
    }

    /// Refits most of the marked nodes, in pieces of the tree that threads share. What is still marked
    /// then has parents or children in other pieces.
    #[cfg(feature = "parallel")]
    fn refit_in_pieces(&mut self, measures: bool) {
        use rayon::prelude::*;
        let size = self.nodes.len().div_ceil(PIECES).next_multiple_of(BLOCK);
        if size >= self.nodes.len() {
            return;
        }
        let Self { nodes, state, maps, root, .. } = self;
        let RefitData { wide, attribute_sums: sums, dirty, .. } = state.data_mut();
        let weights = maps.weights.as_deref();
        let marks = dirty.words.par_chunks_mut(size / WORD).zip(dirty.filled.par_chunks_mut(size / BLOCK));
        let lists = wide.par_chunks_mut(size).zip(sums.par_chunks_mut(size));
        let pieces = nodes.par_chunks_mut(size).zip(lists).zip(marks).enumerate();
        let roots = pieces.map(|(piece, ((nodes, (wide, sums)), (words, filled)))| {
            let end = nodes.len();
            let slices = NodeSlices { base: piece * size, nodes, wide, sums, words, filled, weights };
            with_vectors(Follow { slices, end, limit: usize::MAX, measures, visit: |_| {} })
        });
        *root = roots.reduce(|| None, Option::or).unwrap_or(*root);
    }

    /// The clusters of the lights of a tree of one node.
    pub(super) fn wide_of_only_node(&self) -> WideCluster {
        let mut wide = WideCluster::EMPTY;
        for slot in 0..self.nodes[0].count() {
            if let Some(ChildRef::Leaf(light)) = self.nodes[0].child(slot) {
                wide.set(slot, &self.lights[light as usize].cluster());
            }
        }
        wide
    }

    /// Refits a tree of one node, from its lights alone.
    pub(super) fn refit_only_node(&mut self, measures: bool) {
        let (wide, sums) = (&mut [self.wide_of_only_node()], &mut [AttributeSums::default()]);
        let (nodes, weights, words, filled) = (&mut self.nodes[..], self.maps.weights.as_deref(), &mut [1], &mut [1]);
        let slices = NodeSlices { base: 0, nodes, wide, sums, words, filled, weights };
        let follow = Follow { slices, end: 1, limit: 1, measures, visit: |_| {} };
        self.root = with_vectors(follow).unwrap_or(self.root);
        if measures {
            self.set_attributes(&sums[0]);
        }
        self.state = TreeState::Small { is_dirty: false, is_refitted: true };
    }

    fn set_attributes(&mut self, sums: &AttributeSums) {
        self.quality.attributes = sums.relative_to(&self.root);
        self.quality.cost = sums.cost_per_spread(&self.root);
    }
}

/// The same piece of all arrays of a tree.
struct NodeSlices<'a> {
    /// The index of the first node, a multiple of [`BLOCK`].
    base: usize,
    nodes: &'a mut [Node],
    wide: &'a mut [WideCluster],
    sums: &'a mut [AttributeSums],
    /// The nodes to refit, as in [`DirtyNodes`](super::dirty::DirtyNodes).
    words: &'a mut [u32],
    filled: &'a mut [u32],
    /// The map that the tree is weighted for.
    weights: Option<&'a Linear>,
}

impl NodeSlices<'_> {
    /// Whether the parent and all children of a node are in these slices.
    #[inline(always)]
    fn has_links_of(&self, node: &Node) -> bool {
        let end = (self.base + self.nodes.len()) as u32;
        let has_children = node.children.iter().all(|child| *child & LEAF != 0 || *child < end);
        has_children && (node.parent == NO_PARENT || node.parent as usize / WIDTH >= self.base)
    }

    /// Refits a node whose children are up to date. Writes its cluster to its parent, and marks that.
    #[inline(always)]
    fn refit(&mut self, local: usize, measures: bool) -> Cluster {
        let node = &mut self.nodes[local];
        let wide = &self.wide[local];
        let merged = wide.merged_for(self.weights);
        let count = node.count();
        node.pack(wide, &merged.cluster.aabb, count);
        node.pack_area_ratios(wide, self.weights);
        if measures {
            let mut sums = AttributeSums::of(wide, &merged);
            for slot in 0..count {
                if let Some(ChildRef::Node(below)) = node.child(slot) {
                    sums.add(&self.sums[below as usize - self.base]);
                }
            }
            self.sums[local] = sums;
        }
        if node.parent != NO_PARENT {
            let parent = node.parent as usize / WIDTH - self.base;
            self.wide[parent].set(node.parent as usize % WIDTH, &merged.cluster);
            self.words[parent / WORD] |= 1 << (parent % WORD);
            self.filled[parent / BLOCK] |= 1 << (parent / WORD % WORD);
        }
        merged.cluster
    }
}

/// Refits marked nodes and the nodes above them, from the last to the first. Returns the cluster of
/// the root if it was refitted.
struct Follow<'a, V> {
    slices: NodeSlices<'a>,
    /// No node from here on is marked.
    end: usize,
    /// The most nodes to refit.
    limit: usize,
    measures: bool,
    /// Called with each node.
    visit: V,
}

impl<V: FnMut(usize)> VectorJob for Follow<'_, V> {
    type Output = Option<Cluster>;

    #[inline(always)]
    fn run(mut self) -> Option<Cluster> {
        let mut root = None;
        let slices = &mut self.slices;
        for block in (0..self.end.div_ceil(BLOCK)).rev() {
            let mut below = !0;
            while let Some(bit) = highest(slices.filled[block] & below) {
                below = (1 << bit) - 1;
                let word = block * WORD + bit;
                let mut below = !0;
                while let Some(bit) = highest(slices.words[word] & below) {
                    below = (1 << bit) - 1;
                    let local = word * WORD + bit;
                    if !slices.has_links_of(&slices.nodes[local]) {
                        continue;
                    }
                    if self.limit == 0 {
                        return root;
                    }
                    self.limit -= 1;
                    slices.words[word] &= !(1 << bit);
                    let cluster = slices.refit(local, self.measures);
                    (self.visit)(slices.base + local);
                    if slices.base + local == 0 {
                        root = Some(cluster);
                    }
                }
                if slices.words[word] == 0 {
                    slices.filled[block] &= !(1 << bit);
                }
            }
        }
        root
    }
}

/// The place of the highest bit.
#[inline(always)]
fn highest(bits: u32) -> Option<usize> {
    bits.checked_ilog2().map(|bit| bit as usize)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Light;

    #[test]
    fn a_refit_gives_the_same_bits_with_vector_instructions_and_without() {
        let turn = |i: usize, speed: f32| (i as f32 * speed).sin();
        let light = |i: usize| {
            let place = Vec3::new(turn(i, 0.7), turn(i, 1.3), turn(i, 2.1)) * 30.0;
            let (u, v) = (Vec3::new(turn(i, 0.3), 0.2, 0.0), Vec3::new(0.0, turn(i, 0.9), 0.3));
            let emission = Vec3::splat(1.0 + turn(i, 3.7));
            if i.is_multiple_of(2) { Light::rectangle(place, u, v, emission) } else { Light::point(place, emission) }
        };
        let mut tree = LightTree::build((0..2000).map(light).collect());
        let changes: Vec<_> = (0..2000).map(|i| (i as u32, light(i + 5000))).collect();
        tree.apply(&changes);
        let mut plain = tree.clone();
        tree.refit_marked(true);
        let (end, limit, measures, visit) = (plain.nodes.len(), usize::MAX, true, |_| {});
        let RefitData { wide, attribute_sums: sums, dirty, .. } = plain.state.data_mut();
        let (nodes, words, filled) = (&mut plain.nodes[..], &mut dirty.words[..], &mut dirty.filled[..]);
        let slices = NodeSlices { base: 0, nodes, wide, sums, words, filled, weights: None };
        plain.root = Follow { slices, end, limit, measures, visit }.run().expect("the root was refitted");
        assert_eq!(tree.nodes, plain.nodes);
        assert_eq!(format!("{:?}", tree.state.data().wide), format!("{:?}", plain.state.data().wide));
        assert_eq!(
            format!("{:?}", tree.state.data().attribute_sums),
            format!("{:?}", plain.state.data().attribute_sums)
        );
        assert_eq!(tree.root, plain.root);
        tree.check().expect("the tree is sound");
    }
}

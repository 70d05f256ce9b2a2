//! Refits a tree: brings its nodes up to date with lights that moved, turned or dimmed, from the
//! leaves to the root, and computes the attributes.
//!
//! Functions with the parameter `MEASURE` compute the sums for the attributes only if it is true.

use std::ops::Range;

use super::LightTree;
use super::attributes::AttributeSums;
use super::node::{ChildRef, NO_PARENT, Node, WIDTH};
use super::refit_data::RefitData;
use super::tasks::{RefitTask, RefitTasks};
use super::wide::WideCluster;
use crate::cluster::{Cluster, Linear};
use crate::math::simd::{VectorJob, with_vectors};

/// A refit visits a list of nodes if fewer than one in this many changed, and sweeps over all nodes
/// otherwise. The list is a heap, which costs about as much per node as the refit of a node.
const NODES_PER_LISTED: usize = 8;

impl LightTree {
    /// Updates every node above a changed light, and the attributes. The shape of the tree stays.
    ///
    /// Every cluster is recomputed from its children, so rounding does not add up over many
    /// refits. O(changed lights · depth), and at most O(nodes). Allocates nothing, except what
    /// rayon needs to share a large tree among threads, and the dropped data of a frozen tree.
    pub fn refit(&mut self) {
        if self.is_frozen() && !self.has_stale_sums {
            return;
        }
        self.thaw();
        let are_sums_stale = std::mem::take(&mut self.has_stale_sums);
        if self.nodes.len() <= 1 {
            if self.nodes.len() == 1 && (self.is_only_node_dirty || are_sums_stale) {
                self.refit_only_node::<true>();
            }
            return;
        }
        if are_sums_stale {
            self.mark_all();
            self.refit_all::<true>();
        } else {
            self.refit_dirty::<true>();
        }
        self.update_sides();
        self.update_attributes();
    }

    /// [`LightTree::refit`] if lights have changed since the last refit. O(1) otherwise.
    pub(crate) fn refit_changes(&mut self) {
        if self.is_dirty() {
            self.refit();
        }
    }

    /// Whether lights have changed since the last refit.
    pub(super) fn is_dirty(&self) -> bool {
        self.is_only_node_dirty || self.refit_data.dirty.len() > 0
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
    pub(super) fn refit_only_node<const MEASURE: bool>(&mut self) {
        let (wide, sums) = (&mut [self.wide_of_only_node()], &mut [AttributeSums::default()]);
        let is_dirty = &mut [true];
        let slices =
            NodeSlices { base: 0, nodes: &mut self.nodes, wide, sums, is_dirty, weights: self.weights.as_deref() };
        if let Some(cluster) = with_vectors(Sweep::<MEASURE>(slices)) {
            self.root = cluster;
        }
        if MEASURE {
            self.set_attributes(&sums[0]);
        }
        (self.is_only_node_dirty, self.is_only_node_refitted) = (false, true);
    }

    /// Copies the clusters of the sides, which frozen trees keep.
    pub(super) fn update_sides(&mut self) {
        let Some(root) = self.refit_data.wide.first() else { return };
        (0..).zip(&mut self.sides).for_each(|(slot, side)| *side = root.get(slot));
    }

    /// Computes the attributes of the tree from the sums at its root.
    pub(super) fn update_attributes(&mut self) {
        let sums = self.refit_data.attribute_sums.first().copied().unwrap_or_default();
        self.set_attributes(&sums);
    }

    fn set_attributes(&mut self, sums: &AttributeSums) {
        self.attributes = sums.relative_to(&self.root);
        self.cost = sums.cost_per_spread(&self.root);
    }

    /// Refits the marked ones of some consecutive nodes of a tree that is being built. The marked
    /// nodes after them have been refitted.
    pub(super) fn refit_nodes(&mut self, range: Range<usize>) {
        if let Some(cluster) = with_vectors(SweepRange(self.slices(), range)) {
            self.root = cluster;
        }
    }

    /// [`LightTree::refit`] without the attributes, for trees whose attributes are not read. They
    /// keep their values until the next [`LightTree::refit`], which then visits all nodes. The
    /// nodes have the same bits as after [`LightTree::refit`].
    pub fn refit_without_attributes(&mut self) {
        self.has_stale_sums |= self.is_dirty();
        if self.is_only_node_dirty {
            return self.refit_only_node::<false>();
        }
        self.refit_dirty::<false>();
        self.update_sides();
    }

    fn refit_dirty<const MEASURE: bool>(&mut self) {
        if self.refit_data.dirty.len() == 0 {
            return;
        }
        if self.refit_data.dirty.len() < self.nodes.len().div_ceil(NODES_PER_LISTED) {
            with_vectors(RefitListed::<MEASURE>(self));
        } else {
            self.refit_all::<MEASURE>();
        }
    }

    /// Marks all nodes that have children.
    pub(super) fn mark_all(&mut self) {
        let is_used = self.spans.iter().map(|span| *span > 0);
        self.refit_data.dirty.flags_mut().iter_mut().zip(is_used).for_each(|(flag, is_used)| *flag = is_used);
    }

    /// Sweeps over all nodes: over the subtrees in parallel, then over the nodes above them. Over
    /// all nodes in turn if subtrees are not contiguous.
    pub(super) fn refit_all<const MEASURE: bool>(&mut self) {
        self.refit_data.dirty.drop_order();
        self.refit_data.refitted.add_all();
        if self.edited.has_stale_tasks() {
            self.edited.renewed_tasks();
            self.refit_data.tasks = RefitTasks::new(&self.spans);
        }
        if self.edited.is_scattered() {
            if let Some(cluster) = with_vectors(Sweep::<MEASURE>(self.slices())) {
                self.root = cluster;
            }
            return;
        }
        let mut subtrees = std::mem::take(&mut self.refit_data.tasks.subtrees);
        sweep_tasks::<MEASURE>(&mut subtrees, self.slices());
        self.refit_data.tasks.subtrees = subtrees;
        with_vectors(SweepUpper::<MEASURE>(self));
    }

    /// All nodes, with what refits know of them.
    fn slices(&mut self) -> NodeSlices<'_> {
        let Self { nodes, refit_data, weights, .. } = self;
        let RefitData { wide, attribute_sums: sums, dirty, .. } = &mut **refit_data;
        NodeSlices { base: 0, nodes, wide, sums, is_dirty: dirty.flags_mut(), weights: weights.as_deref() }
    }
}

/// The same piece of all arrays of a tree.
struct NodeSlices<'a> {
    /// The index of the first node.
    base: usize,
    nodes: &'a mut [Node],
    wide: &'a mut [WideCluster],
    sums: &'a mut [AttributeSums],
    is_dirty: &'a mut [bool],
    /// The map that the tree is weighted for.
    weights: Option<&'a Linear>,
}

impl NodeSlices<'_> {
    /// The nodes before index `at` of the tree, and the other nodes.
    fn split(self, at: usize) -> (Self, Self) {
        let (nodes, nodes_b) = self.nodes.split_at_mut(at - self.base);
        let (wide, wide_b) = self.wide.split_at_mut(at - self.base);
        let (sums, sums_b) = self.sums.split_at_mut(at - self.base);
        let (is_dirty, is_dirty_b) = self.is_dirty.split_at_mut(at - self.base);
        let second = Self { base: at, nodes: nodes_b, wide: wide_b, sums: sums_b, is_dirty: is_dirty_b, ..self };
        (Self { nodes, wide, sums, is_dirty, ..self }, second)
    }

    /// Refits a node whose children are up to date. Writes its cluster to its parent if that is in
    /// these slices.
    #[inline(always)]
    fn refit<const MEASURE: bool>(&mut self, index: usize) -> Cluster {
        let local = index - self.base;
        let node = &mut self.nodes[local];
        let wide = &self.wide[local];
        let merged = wide.merged_for(self.weights);
        let count = node.count();
        node.pack(wide, &merged.cluster.aabb, count);
        node.pack_area_ratios(wide, self.weights);
        if MEASURE {
            let mut sums = AttributeSums::of(wide, &merged);
            for slot in 0..count {
                if let Some(ChildRef::Node(below)) = node.child(slot) {
                    sums.add(&self.sums[below as usize - self.base]);
                }
            }
            self.sums[local] = sums;
        }
        self.is_dirty[local] = false;
        let parent = node.parent as usize / WIDTH;
        if node.parent != NO_PARENT && parent >= self.base {
            self.wide[parent - self.base].set(node.parent as usize % WIDTH, &merged.cluster);
        }
        merged.cluster
    }
}

/// Refits subtrees in parallel. `slices` hold all of their nodes.
fn sweep_tasks<const MEASURE: bool>(subtrees: &mut [RefitTask], slices: NodeSlices<'_>) {
    match subtrees {
        [] => {}
        [subtree] => {
            let (_, slices) = slices.split(subtree.root);
            let (slices, _) = slices.split(subtree.root + subtree.nodes);
            subtree.changed = with_vectors(Sweep::<MEASURE>(slices));
        }
        _ => {
            let (left, right) = subtrees.split_at_mut(subtrees.len() / 2);
            let (left_slices, right_slices) = slices.split(right[0].root);
            #[cfg(feature = "parallel")]
            rayon::join(|| sweep_tasks::<MEASURE>(left, left_slices), || sweep_tasks::<MEASURE>(right, right_slices));
            #[cfg(not(feature = "parallel"))]
            {
                sweep_tasks::<MEASURE>(left, left_slices);
                sweep_tasks::<MEASURE>(right, right_slices);
            }
        }
    }
}

/// Refits the marked nodes of one subtree and the nodes above them. Returns the cluster of the
/// subtree's root if that changed.
struct Sweep<'a, const MEASURE: bool>(NodeSlices<'a>);

impl<const MEASURE: bool> VectorJob for Sweep<'_, MEASURE> {
    type Output = Option<Cluster>;

    #[inline(always)]
    fn run(self) -> Option<Cluster> {
        let Self(mut slices) = self;
        let mut root = None;
        for local in (0..slices.nodes.len()).rev() {
            if slices.is_dirty[local] {
                let cluster = slices.refit::<MEASURE>(slices.base + local);
                let parent = slices.nodes[local].parent as usize / WIDTH;
                if local > 0 {
                    slices.is_dirty[parent - slices.base] = true;
                } else {
                    root = Some(cluster);
                }
            }
        }
        root
    }
}

/// Refits the marked nodes of a range, and marks no others. Returns the cluster of the root if the
/// range contains it.
struct SweepRange<'a>(NodeSlices<'a>, Range<usize>);

impl VectorJob for SweepRange<'_> {
    type Output = Option<Cluster>;

    #[inline(always)]
    fn run(self) -> Option<Cluster> {
        let Self(mut slices, range) = self;
        let mut last = None;
        let has_root = range.start == 0;
        for node in range.rev() {
            if slices.is_dirty[node] {
                last = Some(slices.refit::<true>(node));
            }
        }
        last.filter(|_| has_root)
    }
}

/// Refits the nodes above the subtrees that were refitted in parallel.
struct SweepUpper<'a, const MEASURE: bool>(&'a mut LightTree);

impl<const MEASURE: bool> VectorJob for SweepUpper<'_, MEASURE> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let LightTree { nodes, refit_data, root, weights, .. } = self.0;
        let RefitData { wide, attribute_sums: sums, dirty, tasks, .. } = &mut **refit_data;
        let mut slices =
            NodeSlices { base: 0, nodes, wide, sums, is_dirty: dirty.flags_mut(), weights: weights.as_deref() };
        for subtree in &mut tasks.subtrees {
            let Some(cluster) = subtree.changed.take() else { continue };
            let parent = slices.nodes[subtree.root].parent;
            if parent == NO_PARENT {
                *root = cluster;
            } else {
                slices.wide[parent as usize / WIDTH].set(parent as usize % WIDTH, &cluster);
                slices.is_dirty[parent as usize / WIDTH] = true;
            }
        }
        for node in tasks.upper.iter().rev() {
            let node = *node as usize;
            if slices.is_dirty[node] {
                let cluster = slices.refit::<MEASURE>(node);
                match slices.nodes[node].parent {
                    NO_PARENT => *root = cluster,
                    parent => slices.is_dirty[parent as usize / WIDTH] = true,
                }
            }
        }
    }
}

/// Refits the nodes of a list and the nodes above them.
struct RefitListed<'a, const MEASURE: bool>(&'a mut LightTree);

impl<const MEASURE: bool> VectorJob for RefitListed<'_, MEASURE> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let LightTree { nodes, refit_data, root, weights, .. } = self.0;
        let RefitData { wide, attribute_sums: sums, dirty, refitted, .. } = &mut **refit_data;
        while let Some(node) = dirty.pop() {
            refitted.add(node);
            let mut slices =
                NodeSlices { base: 0, nodes, wide, sums, is_dirty: dirty.flags_mut(), weights: weights.as_deref() };
            let cluster = slices.refit::<MEASURE>(node);
            match nodes[node].parent {
                NO_PARENT => *root = cluster,
                parent => dirty.insert(parent as usize / WIDTH),
            }
        }
    }
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
        with_vectors(RefitListed::<true>(&mut tree));
        RefitListed::<true>(&mut plain).run();
        assert_eq!(tree.nodes, plain.nodes);
        assert_eq!(format!("{:?}", tree.refit_data), format!("{:?}", plain.refit_data));
        assert_eq!(tree.root, plain.root);
        tree.check().expect("the tree is sound");
    }
}

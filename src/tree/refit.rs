//! Brings the nodes up to date with lights that moved, turned or dimmed, bottom up, and measures the attributes.

use super::attributes::Terms;
use super::node::{NO_PARENT, Node, WIDTH};
use super::wide::WideCluster;
use super::{LightTree, Target};
use crate::cluster::Cluster;
use crate::simd::{Job, with_vectors};

/// A refit visits all nodes, and not only a list of those that changed, from one in so many on: a list is a heap, which
/// costs about as much as a node.
const FEW: usize = 8;

/// Subtrees of up to so many nodes are refitted by one thread: some hundred microseconds, while waking a thread takes
/// several.
const TASK_NODES: u32 = 1024;

impl LightTree {
    /// Brings every node above a changed light up to date. The shape of the tree stays; nothing is allocated, but for
    /// what rayon needs to share large trees among threads.
    ///
    /// Every cluster is made from its children anew, so a million refits drift no further than one. O(changed lights x
    /// depth), and never more than all nodes.
    pub fn refit(&mut self) {
        if self.is_frozen() {
            if !self.is_unmeasured {
                return;
            }
            self.thaw();
        }
        if std::mem::take(&mut self.is_unmeasured) {
            let is_used = self.spans.iter().map(|span| *span > 0);
            self.dirty.flags_mut().iter_mut().zip(is_used).for_each(|(flag, is_used)| *flag = is_used);
            self.refit_all::<true>();
        } else {
            self.refit_dirty::<true>();
        }
        self.attributes = self.terms.first().copied().unwrap_or_default().relative_to(&self.cluster());
    }

    /// [`LightTree::refit`] for trees that are never rebuilt, whose attributes nobody reads: those stay as they are
    /// until the next [`LightTree::refit`], which then visits all nodes. The nodes are the same to the last bit.
    pub fn refit_without_attributes(&mut self) {
        self.is_unmeasured |= self.dirty.len() > 0;
        self.refit_dirty::<false>();
    }

    fn refit_dirty<const MEASURE: bool>(&mut self) {
        if self.dirty.len() * FEW < self.nodes.len() {
            with_vectors(Few::<MEASURE>(self));
        } else {
            self.refit_all::<MEASURE>();
        }
    }

    /// Sweeps over all nodes: subtrees in parallel, then what is above them.
    fn refit_all<const MEASURE: bool>(&mut self) {
        self.dirty.forget_order();
        let Self { nodes, wide, terms, dirty, tasks, .. } = self;
        let part = Part { base: 0, nodes, wide, terms, is_dirty: dirty.flags_mut() };
        sweep_tasks::<MEASURE>(&mut tasks.subtrees, part);
        with_vectors(Upper::<MEASURE>(self));
    }
}

impl LightTree {
    /// Refits a subtree all of whose nodes are marked, and marks what is above it.
    pub(super) fn refit_subtree(&mut self, root: usize) {
        if root == 0 {
            return self.refit_all::<true>();
        }
        let Self { nodes, wide, terms, dirty, spans, .. } = self;
        let end = root + spans[root] as usize;
        let (_, part) = Part { base: 0, nodes, wide, terms, is_dirty: dirty.flags_mut() }.split(root);
        let (part, _) = part.split(end);
        let parent = part.nodes[0].parent as usize;
        if let Some(cluster) = with_vectors(Sweep::<true>(part)) {
            self.wide[parent / WIDTH].set(parent % WIDTH, &cluster);
            self.dirty.insert(parent / WIDTH);
        }
    }
}

/// The subtrees that are refitted by themselves and the nodes above them, for a shape.
#[derive(Clone, Debug, Default)]
pub(super) struct Tasks {
    subtrees: Vec<Subtree>,
    upper: Vec<u32>,
}

#[derive(Clone, Debug)]
struct Subtree {
    root: usize,
    nodes: usize,
    /// The root's cluster, if it changed: its parent lies in nobody's part.
    changed: Option<Cluster>,
}

impl Tasks {
    /// Of a tree whose nodes have these spans.
    pub fn new(spans: &[u32]) -> Self {
        let mut tasks = Self::default();
        let mut node = 0;
        while node < spans.len() {
            if spans[node] > TASK_NODES {
                tasks.upper.push(node as u32);
                node += 1;
            } else {
                let nodes = spans[node].max(1) as usize;
                tasks.subtrees.push(Subtree { root: node, nodes, changed: None });
                node += nodes;
            }
        }
        tasks
    }

    /// Bytes.
    pub fn memory(&self) -> usize {
        size_of::<Subtree>() * self.subtrees.capacity() + size_of::<u32>() * self.upper.capacity()
    }
}

/// A piece of a tree's arrays.
struct Part<'a> {
    /// The index of the first node.
    base: usize,
    nodes: &'a mut [Node],
    wide: &'a mut [WideCluster],
    terms: &'a mut [Terms],
    is_dirty: &'a mut [bool],
}

impl Part<'_> {
    /// The nodes before index `at` of the tree, and the others.
    fn split(self, at: usize) -> (Self, Self) {
        let (nodes, nodes_b) = self.nodes.split_at_mut(at - self.base);
        let (wide, wide_b) = self.wide.split_at_mut(at - self.base);
        let (terms, terms_b) = self.terms.split_at_mut(at - self.base);
        let (is_dirty, is_dirty_b) = self.is_dirty.split_at_mut(at - self.base);
        let second = Self { base: at, nodes: nodes_b, wide: wide_b, terms: terms_b, is_dirty: is_dirty_b };
        (Self { nodes, wide, terms, is_dirty, ..self }, second)
    }

    /// Refits a node whose children are up to date, and tells its parent if that lies in this part.
    #[inline(always)]
    fn refit<const MEASURE: bool>(&mut self, index: usize) -> Cluster {
        let local = index - self.base;
        let node = &mut self.nodes[local];
        let wide = &self.wide[local];
        let merged = wide.merged();
        let count = node.count();
        node.pack(wide, &merged.cluster.aabb, count);
        if MEASURE {
            let mut terms = Terms::of(wide, &merged);
            for slot in 0..count {
                if let Some(Target::Node(below)) = node.target(slot) {
                    terms.add(&self.terms[below as usize - self.base]);
                }
            }
            self.terms[local] = terms;
        }
        self.is_dirty[local] = false;
        let parent = node.parent as usize / WIDTH;
        if node.parent != NO_PARENT && parent >= self.base {
            self.wide[parent - self.base].set(node.parent as usize % WIDTH, &merged.cluster);
        }
        merged.cluster
    }
}

/// Refits subtrees that lie in a part, each in one piece.
fn sweep_tasks<const MEASURE: bool>(subtrees: &mut [Subtree], part: Part<'_>) {
    match subtrees {
        [] => {}
        [subtree] => {
            let (_, part) = part.split(subtree.root);
            let (part, _) = part.split(subtree.root + subtree.nodes);
            subtree.changed = with_vectors(Sweep::<MEASURE>(part));
        }
        _ => {
            let (left, right) = subtrees.split_at_mut(subtrees.len() / 2);
            let (left_part, right_part) = part.split(right[0].root);
            #[cfg(feature = "parallel")]
            rayon::join(|| sweep_tasks::<MEASURE>(left, left_part), || sweep_tasks::<MEASURE>(right, right_part));
            #[cfg(not(feature = "parallel"))]
            {
                sweep_tasks::<MEASURE>(left, left_part);
                sweep_tasks::<MEASURE>(right, right_part);
            }
        }
    }
}

/// Refits the dirty nodes of one subtree; returns its root's cluster, if that changed.
struct Sweep<'a, const MEASURE: bool>(Part<'a>);

impl<const MEASURE: bool> Job for Sweep<'_, MEASURE> {
    type Output = Option<Cluster>;

    #[inline(always)]
    fn run(self) -> Option<Cluster> {
        let Self(mut part) = self;
        let mut root = None;
        for local in (0..part.nodes.len()).rev() {
            if part.is_dirty[local] {
                let cluster = part.refit::<MEASURE>(part.base + local);
                let parent = part.nodes[local].parent as usize / WIDTH;
                if local > 0 {
                    part.is_dirty[parent - part.base] = true;
                } else {
                    root = Some(cluster);
                }
            }
        }
        root
    }
}

/// Refits what lies above the subtrees.
struct Upper<'a, const MEASURE: bool>(&'a mut LightTree);

impl<const MEASURE: bool> Job for Upper<'_, MEASURE> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let LightTree { nodes, wide, terms, dirty, tasks, root, .. } = self.0;
        let mut part = Part { base: 0, nodes, wide, terms, is_dirty: dirty.flags_mut() };
        for subtree in &mut tasks.subtrees {
            let Some(cluster) = subtree.changed.take() else { continue };
            let parent = part.nodes[subtree.root].parent;
            if parent == NO_PARENT {
                *root = cluster;
            } else {
                part.wide[parent as usize / WIDTH].set(parent as usize % WIDTH, &cluster);
                part.is_dirty[parent as usize / WIDTH] = true;
            }
        }
        for node in tasks.upper.iter().rev() {
            let node = *node as usize;
            if part.is_dirty[node] {
                let cluster = part.refit::<MEASURE>(node);
                match part.nodes[node].parent {
                    NO_PARENT => *root = cluster,
                    parent => part.is_dirty[parent as usize / WIDTH] = true,
                }
            }
        }
    }
}

/// Refits a few nodes and what is above them.
struct Few<'a, const MEASURE: bool>(&'a mut LightTree);

impl<const MEASURE: bool> Job for Few<'_, MEASURE> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let LightTree { nodes, wide, terms, dirty, root, .. } = self.0;
        while let Some(node) = dirty.pop() {
            let mut part = Part { base: 0, nodes, wide, terms, is_dirty: dirty.flags_mut() };
            let cluster = part.refit::<MEASURE>(node);
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
    fn refits_are_the_same_bits_with_vectors_and_without() {
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
        with_vectors(Few::<true>(&mut tree));
        Few::<true>(&mut plain).run();
        assert_eq!(tree.nodes, plain.nodes);
        assert_eq!(tree.wide, plain.wide);
        assert_eq!(format!("{:?}", tree.terms), format!("{:?}", plain.terms));
        assert_eq!(tree.root, plain.root);
        tree.check().expect("sound");
    }
}

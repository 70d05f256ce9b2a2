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

/// Subtrees of up to so many nodes are refitted by one thread: some hundred microseconds, while waking a thread takes several.
const TASK_NODES: u32 = 1024;

impl LightTree {
    /// Brings every node above a changed light up to date. The shape of the tree stays; nothing is allocated.
    ///
    /// Every cluster is made from its children anew, so a million refits drift no further than one. O(changed lights x
    /// depth), and never more than all nodes.
    pub fn refit(&mut self) {
        if self.dirty.len() * FEW < self.nodes.len() {
            with_vectors(Few(self));
        } else {
            self.refit_all();
        }
        self.attributes = self.terms.first().copied().unwrap_or_default().relative_to(&self.cluster());
    }

    /// Sweeps over all nodes: subtrees in parallel, then what is above them.
    fn refit_all(&mut self) {
        self.dirty.forget_order();
        let Self { nodes, wide, terms, dirty, tasks, .. } = self;
        let part = Part { base: 0, nodes, wide, terms, is_dirty: dirty.flags_mut() };
        sweep_tasks(&mut tasks.subtrees, part);
        with_vectors(Upper(self));
    }
}

impl LightTree {
    /// Refits a subtree all of whose nodes are marked, and marks what is above it.
    pub(super) fn refit_subtree(&mut self, root: usize) {
        if root == 0 {
            return self.refit_all();
        }
        let Self { nodes, wide, terms, dirty, spans, .. } = self;
        let end = root + spans[root] as usize;
        let (_, part) = Part { base: 0, nodes, wide, terms, is_dirty: dirty.flags_mut() }.split(root);
        let (part, _) = part.split(end);
        let parent = part.nodes[0].parent as usize;
        if let Some(cluster) = with_vectors(Sweep(part)) {
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
    fn refit(&mut self, index: usize) -> Cluster {
        let local = index - self.base;
        let node = &mut self.nodes[local];
        let wide = &self.wide[local];
        let merged = wide.merged();
        let count = node.count();
        node.pack(wide, &merged.cluster.aabb, count);
        let mut terms = Terms::of(wide, &merged);
        for slot in 0..count {
            if let Some(Target::Node(below)) = node.target(slot) {
                terms.add(&self.terms[below as usize - self.base]);
            }
        }
        self.terms[local] = terms;
        self.is_dirty[local] = false;
        let parent = node.parent as usize / WIDTH;
        if node.parent != NO_PARENT && parent >= self.base {
            self.wide[parent - self.base].set(node.parent as usize % WIDTH, &merged.cluster);
        }
        merged.cluster
    }
}

/// Refits subtrees that lie in a part, each in one piece.
fn sweep_tasks(subtrees: &mut [Subtree], part: Part<'_>) {
    match subtrees {
        [] => {}
        [subtree] => {
            let (_, part) = part.split(subtree.root);
            let (part, _) = part.split(subtree.root + subtree.nodes);
            subtree.changed = with_vectors(Sweep(part));
        }
        _ => {
            let (left, right) = subtrees.split_at_mut(subtrees.len() / 2);
            let (left_part, right_part) = part.split(right[0].root);
            #[cfg(feature = "parallel")]
            rayon::join(|| sweep_tasks(left, left_part), || sweep_tasks(right, right_part));
            #[cfg(not(feature = "parallel"))]
            {
                sweep_tasks(left, left_part);
                sweep_tasks(right, right_part);
            }
        }
    }
}

/// Refits the dirty nodes of one subtree; returns its root's cluster, if that changed.
struct Sweep<'a>(Part<'a>);

impl Job for Sweep<'_> {
    type Output = Option<Cluster>;

    #[inline(always)]
    fn run(self) -> Option<Cluster> {
        let Self(mut part) = self;
        let mut root = None;
        for local in (0..part.nodes.len()).rev() {
            if part.is_dirty[local] {
                let cluster = part.refit(part.base + local);
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
struct Upper<'a>(&'a mut LightTree);

impl Job for Upper<'_> {
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
                let cluster = part.refit(node);
                match part.nodes[node].parent {
                    NO_PARENT => *root = cluster,
                    parent => part.is_dirty[parent as usize / WIDTH] = true,
                }
            }
        }
    }
}

/// Refits a few nodes and what is above them.
struct Few<'a>(&'a mut LightTree);

impl Job for Few<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let LightTree { nodes, wide, terms, dirty, root, .. } = self.0;
        while let Some(node) = dirty.pop() {
            let mut part = Part { base: 0, nodes, wide, terms, is_dirty: dirty.flags_mut() };
            let cluster = part.refit(node);
            match nodes[node].parent {
                NO_PARENT => *root = cluster,
                parent => dirty.insert(parent as usize / WIDTH),
            }
        }
    }
}

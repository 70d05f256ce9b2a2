//! Rebuilds of subtrees that went bad, in their own place: what a deforming tree needs between refits.
//!
//! A subtree lies in one piece and keeps its piece, with some nodes to spare; nothing outside of it moves.

use super::LightTree;
use super::attributes::Terms;
use super::node::{EMPTY_SLOT, LEAF, NO_PARENT, Node, WIDTH};
use super::refit::Tasks;
use super::shape::{Item, ShapeNode, shape};
use super::wide::WideCluster;
use crate::cluster::Cluster;

/// One node in so many is left unused by a build: later shapes of a subtree need a few more or less.
const SPARE: usize = 24;

/// Subtrees of fewer lights are not rebuilt by themselves, nor are those below so small a share of the tree: what they could gain is
/// not worth looking for.
const LEAST_LIGHTS: u32 = 32;
/// See [`LEAST_LIGHTS`].
const LEAST_SHARE: u32 = 256;

/// A rebuild is worth it once a subtree's splitting cost has risen by this share.
const LEAST_LOSS: f32 = 0.05;

impl LightTree {
    /// Rebuilds what gains most: of all subtrees, the whole tree among them, the one whose splitting cost has risen most per light since
    /// it was built, again and again while `lights` last. What is left of them is kept for later calls, up to a rebuild of the
    /// whole tree: where the upper levels went bad, nothing less helps. Returns how many lights were in what was rebuilt.
    ///
    /// To be called after a refit, once a frame; leaves everything up to date. O(n log n) in the lights that are rebuilt.
    /// `docs/benchmarks.md` has what it wins back.
    pub fn rebuild_worst(&mut self, lights: usize) -> usize {
        self.credit = (self.credit + lights).min(self.lights.len());
        let mut rebuilt = 0;
        while let Some(node) = self.worst().filter(|node| self.sizes[*node] as usize <= self.credit) {
            let size = self.sizes[node] as usize;
            self.credit -= size;
            rebuilt += size;
            if node == 0 {
                self.rebuild();
            } else {
                self.rebuild_subtree(node);
            }
        }
        rebuilt
    }

    /// The subtree whose rebuild probably gains most per light; `None` if none is worth it.
    fn worst(&self) -> Option<usize> {
        let least = LEAST_LIGHTS.max(self.lights.len() as u32 / LEAST_SHARE);
        let mut worst = (0.0, None);
        let mut node = 0;
        while node < self.nodes.len() {
            if self.sizes[node] < least {
                node += self.spans[node].max(1) as usize;
                continue;
            }
            let loss = self.loss(node);
            let gain = self.terms[node].cost_share(loss) / f64::from(self.sizes[node]);
            if loss > LEAST_LOSS && gain > worst.0 {
                worst = (gain, Some(node));
            }
            node += 1;
        }
        worst.1
    }

    /// How much the splitting cost of a subtree has risen since it was built, relative.
    fn loss(&self, node: usize) -> f32 {
        self.terms[node].cost_ratio(&self.cluster_of(node)) / self.fresh[node].max(f32::MIN_POSITIVE) - 1.0
    }

    /// Builds a subtree anew. False, and no change, if the new shape needs more nodes than the old one left.
    pub(super) fn rebuild_subtree(&mut self, root: usize) -> bool {
        let span = self.spans[root] as usize;
        let mut members = Vec::with_capacity(self.sizes[root] as usize);
        for node in root..root + span {
            for slot in 0..self.nodes[node].count() {
                let target = self.nodes[node].targets[slot];
                if target & LEAF != 0 {
                    members.push(Member { light: target & !LEAF, cluster: self.wide[node].get(slot) });
                }
            }
        }
        let shapes = shape(&mut items(&members));
        if shapes.len() > span {
            // As good as it gets without moving others.
            self.fresh[root] = self.terms[root].cost_ratio(&self.cluster_of(root));
            return false;
        }
        let parent = self.nodes[root].parent;
        self.nodes[root..root + span].fill(Node::EMPTY);
        self.wide[root..root + span].fill(WideCluster::EMPTY);
        self.terms[root..root + span].fill(Terms::default());
        self.spans[root..root + span].fill(0);
        self.sizes[root..root + span].fill(0);
        self.nodes[root].parent = parent;
        self.place(&shapes, &members, root, span);
        true
    }

    /// Lays out a shape of some lights in empty nodes from `root` on, with the spare ones spread among them, and refits.
    pub(super) fn place(&mut self, shapes: &[ShapeNode], members: &[Member], root: usize, span: usize) {
        let position = |i: usize| root + i + (span - shapes.len()) * i / shapes.len().max(1);
        let parent = self.nodes[root].parent;
        for (i, shape) in shapes.iter().enumerate() {
            let node = position(i);
            let mut targets = shape.targets;
            // All at once: they lie anywhere in memory, and waiting for one after the other takes longer than all the rest.
            let is_light = |target: u32| target != EMPTY_SLOT && target & LEAF != 0;
            let found: [Member; WIDTH] =
                targets.map(|target| if is_light(target) { members[(target & !LEAF) as usize] } else { Member::NONE });
            for (slot, target) in targets[..shape.count as usize].iter_mut().enumerate() {
                if *target & LEAF != 0 {
                    let Member { light, cluster } = &found[slot];
                    self.leaves[*light as usize] = (node * WIDTH + slot) as u32;
                    self.wide[node].set(slot, cluster);
                    *target = light | LEAF;
                } else {
                    *target = position(*target as usize) as u32;
                }
            }
            let above = match shape.parent {
                NO_PARENT => parent,
                place => (position(place as usize / WIDTH) * WIDTH) as u32 + place % WIDTH as u32,
            };
            self.nodes[node] = Node { targets, parent: above, steps: shape.count << 24, ..Node::EMPTY };
            self.spans[node] = (position(i + shape.span as usize) - node) as u32;
            self.dirty.flags_mut()[node] = true;
        }
        for node in (root..root + span).rev() {
            self.sizes[node] = self.nodes[node].targets[..self.nodes[node].count()]
                .iter()
                .map(|target| if target & LEAF != 0 { 1 } else { self.sizes[*target as usize] })
                .sum();
        }
        self.tasks = Tasks::new(&self.spans);
        self.refit_subtree(root);
        self.refit();
        for node in root..root + span {
            self.fresh[node] = self.terms[node].cost_ratio(&self.cluster_of(node));
        }
    }

    /// A node's own cluster.
    fn cluster_of(&self, node: usize) -> Cluster {
        match self.nodes[node].parent {
            NO_PARENT => self.root,
            place => self.wide[place as usize / WIDTH].get(place as usize % WIDTH),
        }
    }
}

/// A light that is placed.
#[derive(Clone, Copy)]
pub(super) struct Member {
    /// Its index.
    pub light: u32,
    pub cluster: Cluster,
}

impl Member {
    const NONE: Self = Self { light: u32::MAX, cluster: Cluster::EMPTY };
}

/// What a shape is made of: members by their place in the list.
pub(super) fn items(members: &[Member]) -> Vec<Item> {
    (0..).zip(members).map(|(index, member)| Item::new(&member.cluster, index)).collect()
}

/// Nodes to be kept for a shape of so many, with some to spare.
pub(super) fn with_spare(nodes: usize) -> usize {
    nodes + nodes / SPARE
}

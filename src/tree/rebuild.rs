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

/// Subtrees of fewer lights are not rebuilt by themselves: what they could gain is not worth looking for.
const MIN_LIGHTS: u32 = 32;
/// Nor are subtrees of less than one in so many of the tree's lights.
const MIN_SHARE: u32 = 256;

/// A rebuild is worth it once a subtree's splitting cost has risen by this share.
const MIN_LOSS: f32 = 0.05;

/// A subtree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Part {
    /// Its root.
    node: usize,
    /// Below it.
    pub lights: usize,
}

impl Part {
    /// It is the tree itself.
    pub fn is_whole(&self) -> bool {
        self.node == 0
    }
}

impl LightTree {
    /// Rebuilds what gains most: of all subtrees, the whole tree among them, the one whose splitting cost has risen
    /// most per light since it was built, again and again while `lights` last. What is left of them is kept for later
    /// calls, up to a rebuild of the whole tree: where the upper levels went bad, nothing less helps. Returns how many
    /// lights were in what was rebuilt.
    ///
    /// Trees of fewer than 32 lights are never worth it; [`LightTree::rebuild`] takes them microseconds.
    ///
    /// To be called once a frame; refits first what a refit was not called for. O(n log n) in the lights that are
    /// rebuilt, besides a search among subtrees of 1/256 of the tree and more. `docs/benchmarks.md` has what it wins
    /// back.
    pub fn rebuild_worst(&mut self, lights: usize) -> usize {
        self.thaw();
        self.refit();
        self.credit = self.credit.saturating_add(lights).min(self.lights.len());
        let mut rebuilt = 0;
        while let Some(part) = self.worst(usize::MAX).filter(|part| part.lights <= self.credit) {
            self.credit -= part.lights;
            if self.rebuild_part(part) {
                rebuilt += part.lights;
            }
        }
        rebuilt
    }

    /// How much the tree's splitting cost has risen since its last build, relative to how its lights lie now: 0 is as
    /// good as then, 1 twice as bad. As of the last refit with attributes; 0 for a frozen tree. O(1).
    ///
    /// Unlike [`Attribute::SplittingCost`](super::Attribute) it does not depend on the box around all lights, which one
    /// stray light stretches.
    pub fn cost_rise(&self) -> f32 {
        if self.terms.is_empty() || self.fresh[0] <= 0.0 { 0.0 } else { self.loss(0) }
    }

    /// Builds a part of the tree, or all of it, anew. False, and no change, if its new shape needs more nodes than the
    /// old one left.
    pub(crate) fn rebuild_part(&mut self, part: Part) -> bool {
        if part.is_whole() {
            self.rebuild();
            return true;
        }
        self.rebuild_subtree(part.node)
    }

    /// Gives the place of this tree to one that was built over earlier lights of it. Whether any of them has changed
    /// since, so that it waits for [`LightTree::refit`].
    ///
    /// O(lights), of which those that changed meanwhile count tenfold.
    pub(crate) fn succeed(&mut self, mut built: Self) -> bool {
        let present = std::mem::take(&mut self.lights);
        for (index, light) in (0..).zip(present) {
            if built.lights[index as usize] != light {
                built.apply(&[(index, light)]);
            }
        }
        *self = built;
        self.dirty.len() > 0
    }

    /// The subtree of up to so many lights, or the whole tree, whose rebuild probably gains most per light; `None` if
    /// none is worth it, or if the tree is frozen.
    pub(crate) fn worst(&self, most_lights: usize) -> Option<Part> {
        if self.is_frozen() {
            return None;
        }
        let least = MIN_LIGHTS.max(self.lights.len() as u32 / MIN_SHARE);
        let mut worst = (0.0, None);
        let mut node = 0;
        while node < self.nodes.len() {
            if self.sizes[node] < least {
                node += self.spans[node].max(1) as usize;
                continue;
            }
            let loss = self.loss(node);
            let gain = self.terms[node].cost_share(loss) / f64::from(self.sizes[node]);
            if loss > MIN_LOSS && gain > worst.0 && self.sizes[node] as usize <= most_lights {
                worst = (gain, Some(node));
            }
            node += 1;
        }
        worst.1.map(|node: usize| Part { node, lights: self.sizes[node] as usize })
    }

    /// How much the splitting cost of a subtree has risen since it was built, relative to how its lights lie.
    fn loss(&self, node: usize) -> f32 {
        self.terms[node].cost_per_spread(&self.cluster_of(node)) / self.fresh[node].max(f32::MIN_POSITIVE) - 1.0
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
            self.fresh[root] = self.terms[root].cost_per_spread(&self.cluster_of(root));
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

    /// Lays out a shape of some lights in empty nodes from `root` on, with the spare ones spread among them, and
    /// refits.
    pub(super) fn place(&mut self, shapes: &[ShapeNode], members: &[Member], root: usize, span: usize) {
        let position = |i: usize| root + i + (span - shapes.len()) * i / shapes.len();
        let parent = self.nodes[root].parent;
        for (i, shape) in shapes.iter().enumerate() {
            let node = position(i);
            let mut targets = shape.targets;
            // All at once: they lie anywhere in memory, and waiting for one after the other takes longer than all the
            // rest.
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
            self.fresh[node] = self.terms[node].cost_per_spread(&self.cluster_of(node));
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

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Light;
    use crate::tree::Target;

    /// Random numbers in [0, 1); any will do.
    struct Numbers(u32);

    impl Numbers {
        fn next(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (self.0 >> 8) as f32 / 16_777_216.0
        }

        fn place(&mut self) -> Vec3 {
            Vec3::new(self.next(), self.next(), self.next())
        }
    }

    fn lamp(position: Vec3) -> Light {
        Light::point(position, Vec3::splat(1.0 + position.x))
    }

    fn block(numbers: &mut Numbers, count: usize) -> LightTree {
        LightTree::build((0..count).map(|_| lamp(100.0 * numbers.place())).collect())
    }

    /// The lights below a node, moved.
    fn change_below(tree: &mut LightTree, root: usize, mut place: impl FnMut(usize) -> Vec3) {
        let below = root..root + tree.spans[root] as usize;
        let lights: Vec<u32> =
            (0..).zip(&tree.leaves).filter(|(_, p)| below.contains(&(**p as usize / WIDTH))).map(|(i, _)| i).collect();
        assert_eq!(lights.len(), tree.sizes[root] as usize);
        let changes: Vec<_> = lights.into_iter().enumerate().map(|(i, light)| (light, lamp(place(i)))).collect();
        tree.apply(&changes);
        tree.refit();
    }

    fn ancestors(tree: &LightTree, node: usize) -> Vec<usize> {
        let above =
            |node: &usize| Some(tree.nodes[*node].parent).filter(|p| *p != NO_PARENT).map(|p| p as usize / WIDTH);
        std::iter::successors(above(&node), above).collect()
    }

    /// Everything about a node, as text: floats print as what they are, and NaN equals itself.
    fn all_of(tree: &LightTree, node: usize) -> String {
        let bits = bytemuck::bytes_of(&tree.nodes[node]);
        let LightTree { wide, spans, sizes, fresh, terms, .. } = tree;
        format!("{bits:?} {:?} {} {} {} {:?}", wide[node], spans[node], sizes[node], fresh[node], terms[node])
    }

    #[test]
    fn cost_rises_as_lights_mix_and_not_as_they_move_together() {
        let mut numbers = Numbers(3);
        let mut tree = block(&mut numbers, 500);
        assert_eq!(tree.cost_rise(), 0.0);
        assert_eq!(LightTree::build(Vec::new()).cost_rise(), 0.0);
        let moved = |tree: &LightTree, place: &mut dyn FnMut(&Light) -> Vec3| -> Vec<(u32, Light)> {
            let light = |light: &Light| Light::point(place(light), light.emission);
            (0..).zip(tree.lights.iter().map(light)).collect()
        };
        // A translation of 64 m, which costs a few of the last digits.
        let together = moved(&tree, &mut |light| light.cluster().mean + 64.0 * Vec3::X);
        tree.apply(&together);
        tree.refit();
        assert!(tree.cost_rise().abs() < 1.0e-3, "{}", tree.cost_rise());
        let mixed = moved(&tree, &mut |_| 100.0 * numbers.place());
        tree.apply(&mixed);
        tree.refit();
        assert!(tree.cost_rise() > 1.0, "{}", tree.cost_rise());
        tree.rebuild();
        assert_eq!(tree.cost_rise(), 0.0);
        tree.freeze();
        assert_eq!(tree.cost_rise(), 0.0);
    }

    #[test]
    fn a_rebuilt_subtree_changes_nothing_beside_it() {
        let mut numbers = Numbers(1);
        let mut tree = block(&mut numbers, 3000);
        let children: Vec<_> = tree.nodes[0].targets.iter().filter_map(|target| Target::of(*target)).collect();
        let mut seen = 0;
        for child in children {
            let Target::Node(child) = child else { continue };
            let lower = tree.nodes[child as usize].targets.iter().filter_map(|target| Target::of(*target)).next();
            let lower = if let Some(Target::Node(node)) = lower { node } else { child };
            for root in [child as usize, lower as usize] {
                change_below(&mut tree, root, |_| 100.0 * numbers.place());
                tree.check().expect("sound");
                let before = tree.clone();
                let span = tree.spans[root] as usize;
                if !tree.rebuild_subtree(root) {
                    continue;
                }
                tree.check().expect("sound");
                seen += 1;
                assert_ne!(tree.nodes[root..root + span], before.nodes[root..root + span]);
                let above = ancestors(&tree, root);
                for node in (0..tree.nodes.len()).filter(|node| !(root..root + span).contains(node)) {
                    if above.contains(&node) {
                        let [now, then] =
                            [&tree, &before].map(|tree| (tree.nodes[node].targets, tree.nodes[node].parent));
                        assert_eq!(now, then);
                        assert_eq!((tree.spans[node], tree.sizes[node]), (before.spans[node], before.sizes[node]));
                    } else {
                        assert_eq!(all_of(&tree, node), all_of(&before, node), "node {node} beside {root}");
                    }
                }
                let inside = |place: u32| (root..root + span).contains(&(place as usize / WIDTH));
                for (now, then) in tree.leaves.iter().zip(&before.leaves) {
                    assert!(if inside(*then) { inside(*now) } else { now == then });
                }
                assert_eq!(tree.spans[root] as usize, span);
                assert_eq!(tree.sizes[root], before.sizes[root]);
            }
        }
        assert!(seen >= 8, "only {seen} subtrees rebuilt");
    }

    #[test]
    fn a_shape_that_needs_more_nodes_than_there_are_is_not_used() {
        let mut numbers = Numbers(2);
        // Eight times eight times eight: full nodes. Lights at halving distances make a deep tree of emptier ones.
        let corner = |i: usize| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32);
        let place = |i: usize| 1000.0 * corner(i >> 6) + 50.0 * corner(i >> 3) + corner(i);
        let mut tree = LightTree::build((0..512).map(|i| lamp(place(i) + 0.1 * numbers.place())).collect());
        let root = tree.nodes[0].targets[0] as usize;
        assert_eq!(tree.sizes[root], 64);
        change_below(&mut tree, root, |i| Vec3::X * 0.5_f32.powi(i as i32 % 24) * 100.0 + numbers.place() * 1.0e-5);
        let before = tree.clone();
        assert!(tree.loss(root) > MIN_LOSS);
        assert!(!tree.rebuild_subtree(root));
        tree.check().expect("sound");
        assert_eq!(tree.nodes, before.nodes);
        assert_eq!(tree.leaves, before.leaves);
        // It does not ask again until it is worse still.
        assert!(tree.loss(root).abs() < 1.0e-6);
    }
}

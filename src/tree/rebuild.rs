//! Rebuilds the subtrees of a deforming tree whose cost has risen most, each in its own place.
//!
//! A subtree is contiguous and keeps its range of nodes, spare nodes included. No other node
//! moves.

use super::LightTree;
use super::attributes::AttributeSums;
use super::layout::{PlacedLight, build_items};
use super::node::{LEAF, Node};
use super::shape::shape;
use super::wide::WideCluster;
use crate::light::Light;

/// Smaller subtrees are not rebuilt alone: they could gain too little to be worth the search.
const MIN_LIGHTS: u32 = 32;
/// Subtrees of less than one in this many of the tree's lights are not rebuilt alone either.
const MAX_SUBTREE_SHARE: u32 = 256;

/// A subtree is worth a rebuild once its splitting cost has risen by this share.
const MIN_COST_RISE: f32 = 0.05;

/// A subtree to rebuild, or the whole tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RebuildPart {
    /// The root of the subtree.
    node: usize,
    /// The number of its lights.
    pub lights: usize,
}

impl RebuildPart {
    /// Whether this is the whole tree.
    pub fn is_whole(&self) -> bool {
        self.node == 0
    }
}

impl LightTree {
    /// Rebuilds the parts of the tree whose rebuild gains most per light, and returns the number
    /// of their lights.
    ///
    /// A part is a subtree or the whole tree; its gain is the rise of its splitting cost since it
    /// was built. Each call adds `lights` to a credit, and then rebuilds the best part as long as
    /// the credit covers it. The rest of the credit is kept for later calls, up to one rebuild of
    /// the whole tree: where the upper levels have degraded, nothing less helps. A tree of fewer
    /// than 32 lights is never rebuilt; [`LightTree::rebuild`] takes microseconds for it.
    ///
    /// Where lights were added since the last build, subtrees may not be contiguous. The only part is
    /// then the whole tree.
    ///
    /// Call it once a frame. Refits first if lights have changed since the last refit. O(n log n)
    /// in the rebuilt lights, plus a search among the subtrees that hold 1/256 of the tree or more.
    /// `docs/benchmarks.md` has its effect.
    pub fn rebuild_worst(&mut self, lights: usize) -> usize {
        self.thaw();
        self.refit();
        self.rebuild_credit = self.rebuild_credit.saturating_add(lights).min(self.light_count());
        let mut rebuilt = 0;
        while let Some(part) = self.worst(usize::MAX).filter(|part| part.lights <= self.rebuild_credit) {
            self.rebuild_credit -= part.lights;
            if self.rebuild_part(part) {
                rebuilt += part.lights;
            }
        }
        rebuilt
    }

    /// How much the tree's splitting cost has risen since its last build, relative to the spread of
    /// its lights: 0 if the cost is the same, 1 if it has doubled, negative if it has fallen. As
    /// of the last refit with attributes; 0 for a frozen tree. O(1).
    ///
    /// Unlike [`Attribute::SplittingCost`](super::Attribute) it does not depend on the box around
    /// all lights, which a single stray light stretches.
    pub fn cost_rise(&self) -> f32 {
        if self.attribute_sums.is_empty() || self.built_costs[0] <= 0.0 { 0.0 } else { self.cost_rise_below(0) }
    }

    /// Rebuilds a part of the tree, or all of it. Returns false, and changes nothing, if the new
    /// shape of a subtree needs more nodes than the subtree has.
    pub(crate) fn rebuild_part(&mut self, part: RebuildPart) -> bool {
        if part.is_whole() {
            self.rebuild();
            return true;
        }
        self.rebuild_subtree(part.node)
    }

    /// Replaces this tree by one that was built from an earlier state of its lights. Lights that
    /// have changed since are set again. Returns whether there are any; the tree then needs a
    /// refit, unless it was built again for lights that were added or removed.
    ///
    /// O(lights). Each light that changed costs as much as ten others.
    ///
    /// Lights that were added or removed since are added and removed.
    pub(crate) fn succeed(&mut self, mut built: Self) -> bool {
        let differs = |(index, light): &(u32, Light)| match built.lights.get(*index as usize) {
            Some(then) => then != light,
            None => !light.is_removed(),
        };
        let changes: Vec<(u32, Light)> = (0..).zip(self.lights.iter().copied()).filter(differs).collect();
        let is_built_again = built.apply(&changes);
        if let Some(last) = self.lights.len().checked_sub(1) {
            built.hold_index(last as u32);
        }
        *self = built;
        self.dirty.len() > 0 || is_built_again
    }

    /// The part of up to `max_lights` lights whose rebuild probably gains most per light. `None` if
    /// no part is worth a rebuild, or if the tree is frozen.
    pub(crate) fn worst(&self, max_lights: usize) -> Option<RebuildPart> {
        if self.is_frozen() {
            return None;
        }
        // Where subtrees are not contiguous, only the whole tree can be rebuilt.
        let share = if self.edited.is_scattered() { 1 } else { MAX_SUBTREE_SHARE };
        let min_lights = MIN_LIGHTS.max(self.light_count() as u32 / share);
        let mut worst = (0.0, None);
        let mut node = 0;
        while node < self.nodes.len() {
            let lights = self.light_counts[node];
            if lights < min_lights || (node > 0 && self.edited.is_scattered()) {
                node += self.spans[node].max(1) as usize;
                continue;
            }
            let rise = self.cost_rise_below(node);
            let gain = self.attribute_sums[node].added_cost(rise) / f64::from(lights);
            if rise > MIN_COST_RISE && gain > worst.0 && lights as usize <= max_lights {
                worst = (gain, Some(RebuildPart { node, lights: lights as usize }));
            }
            node += 1;
        }
        worst.1
    }

    /// How much the splitting cost of a subtree has risen since it was built, relative to the
    /// spread of its lights.
    fn cost_rise_below(&self, node: usize) -> f32 {
        self.cost_per_spread(node) / self.built_costs[node].max(f32::MIN_POSITIVE) - 1.0
    }

    /// Rebuilds a subtree. Returns false, and changes no node, if the new shape needs more nodes
    /// than the subtree has.
    fn rebuild_subtree(&mut self, root: usize) -> bool {
        let span = self.spans[root] as usize;
        let mut lights = Vec::with_capacity(self.light_counts[root] as usize);
        for node in root..root + span {
            for slot in 0..self.nodes[node].count() {
                let child = self.nodes[node].children[slot];
                if child & LEAF != 0 {
                    lights.push(PlacedLight { index: child & !LEAF, cluster: self.wide[node].get(slot) });
                }
            }
        }
        let shape = shape(&mut build_items(&lights, self.reference()));
        if shape.len() > span {
            // The present cost counts as the best that these nodes can hold, so later costs are
            // compared with it.
            self.built_costs[root] = self.cost_per_spread(root);
            return false;
        }
        let parent = self.nodes[root].parent;
        self.nodes[root..root + span].fill(Node::EMPTY);
        self.wide[root..root + span].fill(WideCluster::EMPTY);
        self.attribute_sums[root..root + span].fill(AttributeSums::default());
        self.spans[root..root + span].fill(0);
        self.light_counts[root..root + span].fill(0);
        self.nodes[root].parent = parent;
        self.edited.will_lay_out(root..root + span);
        self.lay_out(&shape, &lights, root, span);
        true
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Light;
    use crate::tree::testing::Rng;
    use crate::tree::{ChildRef, NO_PARENT, WIDTH};

    /// A position in a cube of edge `size`.
    fn position(rng: &mut Rng, size: f32) -> Vec3 {
        size * Vec3::new(rng.unit(), rng.unit(), rng.unit())
    }

    fn lamp(position: Vec3) -> Light {
        Light::point(position, Vec3::splat(1.0 + position.x))
    }

    fn random_tree(rng: &mut Rng, count: usize) -> LightTree {
        LightTree::build((0..count).map(|_| lamp(position(rng, 100.0))).collect())
    }

    /// Moves all lights below a node, and refits.
    fn move_lights_below(tree: &mut LightTree, root: usize, mut to: impl FnMut(usize) -> Vec3) {
        let below = root..root + tree.spans[root] as usize;
        let lights: Vec<u32> =
            (0..).zip(&tree.leaves).filter(|(_, p)| below.contains(&(**p as usize / WIDTH))).map(|(i, _)| i).collect();
        assert_eq!(lights.len(), tree.light_counts[root] as usize);
        let changes: Vec<_> = lights.into_iter().enumerate().map(|(i, light)| (light, lamp(to(i)))).collect();
        tree.apply(&changes);
        tree.refit();
    }

    fn ancestors(tree: &LightTree, node: usize) -> Vec<usize> {
        let parent =
            |node: &usize| Some(tree.nodes[*node].parent).filter(|p| *p != NO_PARENT).map(|p| p as usize / WIDTH);
        std::iter::successors(parent(&node), parent).collect()
    }

    /// The complete state of a node as text, in which equal floats look equal and NaN equals NaN.
    fn state_of(tree: &LightTree, node: usize) -> String {
        let bits = bytemuck::bytes_of(&tree.nodes[node]);
        let LightTree { wide, spans, light_counts, built_costs, attribute_sums, .. } = tree;
        format!(
            "{bits:?} {:?} {} {} {} {:?}",
            wide[node], spans[node], light_counts[node], built_costs[node], attribute_sums[node]
        )
    }

    #[test]
    fn the_cost_rises_as_lights_mix_and_not_as_they_move_together() {
        let mut rng = Rng(3);
        let mut tree = random_tree(&mut rng, 500);
        assert_eq!(tree.cost_rise(), 0.0);
        assert_eq!(LightTree::build(Vec::new()).cost_rise(), 0.0);
        let moved = |tree: &LightTree, to: &mut dyn FnMut(&Light) -> Vec3| -> Vec<(u32, Light)> {
            let light = |light: &Light| Light::point(to(light), light.emission);
            (0..).zip(tree.lights.iter().map(light)).collect()
        };
        // A translation by 64 m costs a few of the last digits.
        let together = moved(&tree, &mut |light| light.cluster().mean + 64.0 * Vec3::X);
        tree.apply(&together);
        tree.refit();
        assert!(tree.cost_rise().abs() < 1.0e-3, "{}", tree.cost_rise());
        let mixed = moved(&tree, &mut |_| position(&mut rng, 100.0));
        tree.apply(&mixed);
        tree.refit();
        assert!(tree.cost_rise() > 1.0, "{}", tree.cost_rise());
        tree.rebuild();
        assert_eq!(tree.cost_rise(), 0.0);
        tree.freeze();
        assert_eq!(tree.cost_rise(), 0.0);
    }

    #[test]
    fn a_rebuild_of_a_subtree_changes_no_node_outside_of_it_but_its_ancestors() {
        let mut rng = Rng(1);
        let mut tree = random_tree(&mut rng, 3000);
        let children: Vec<_> = tree.nodes[0].children.iter().filter_map(|child| ChildRef::of(*child)).collect();
        let mut rebuilt = 0;
        for child in children {
            let ChildRef::Node(child) = child else { continue };
            let lower = tree.nodes[child as usize].children.iter().filter_map(|child| ChildRef::of(*child)).next();
            let lower = if let Some(ChildRef::Node(node)) = lower { node } else { child };
            for root in [child as usize, lower as usize] {
                move_lights_below(&mut tree, root, |_| position(&mut rng, 100.0));
                tree.check().expect("the tree is sound after the refit");
                let before = tree.clone();
                let span = tree.spans[root] as usize;
                if !tree.rebuild_subtree(root) {
                    continue;
                }
                tree.check().expect("the tree is sound after the rebuild");
                rebuilt += 1;
                assert_ne!(tree.nodes[root..root + span], before.nodes[root..root + span]);
                let ancestors = ancestors(&tree, root);
                for node in (0..tree.nodes.len()).filter(|node| !(root..root + span).contains(node)) {
                    if ancestors.contains(&node) {
                        let [now, then] =
                            [&tree, &before].map(|tree| (tree.nodes[node].children, tree.nodes[node].parent));
                        assert_eq!(now, then);
                        let [now, then] = [&tree, &before].map(|tree| (tree.spans[node], tree.light_counts[node]));
                        assert_eq!(now, then);
                    } else {
                        assert_eq!(state_of(&tree, node), state_of(&before, node), "node {node}, subtree {root}");
                    }
                }
                let is_inside = |place: u32| (root..root + span).contains(&(place as usize / WIDTH));
                for (now, then) in tree.leaves.iter().zip(&before.leaves) {
                    assert!(if is_inside(*then) { is_inside(*now) } else { now == then });
                }
                assert_eq!(tree.spans[root] as usize, span);
                assert_eq!(tree.light_counts[root], before.light_counts[root]);
            }
        }
        assert!(rebuilt >= 8, "only {rebuilt} subtrees rebuilt");
    }

    #[test]
    fn a_shape_that_needs_more_nodes_than_its_subtree_has_is_not_used() {
        let mut rng = Rng(2);
        // Eight times eight times eight lights make full nodes. Lights at halving distances make a
        // deep tree of emptier nodes.
        let corner = |i: usize| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32);
        let grid = |i: usize| 1000.0 * corner(i >> 6) + 50.0 * corner(i >> 3) + corner(i);
        let mut tree = LightTree::build((0..512).map(|i| lamp(grid(i) + position(&mut rng, 0.1))).collect());
        let root = tree.nodes[0].children[0] as usize;
        assert_eq!(tree.light_counts[root], 64);
        move_lights_below(&mut tree, root, |i| {
            Vec3::X * 0.5_f32.powi(i as i32 % 24) * 100.0 + position(&mut rng, 1.0e-5)
        });
        let before = tree.clone();
        assert!(tree.cost_rise_below(root) > MIN_COST_RISE);
        assert!(!tree.rebuild_subtree(root));
        tree.check().expect("the tree is sound");
        assert_eq!(tree.nodes, before.nodes);
        assert_eq!(tree.leaves, before.leaves);
        // The subtree is not tried again until its cost has risen further.
        assert!(tree.cost_rise_below(root).abs() < 1.0e-6);
    }
}

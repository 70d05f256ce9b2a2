//! Proves that a tree keeps its invariants. Every test of trees calls it after every step.

use super::LightTree;
use super::node::{ChildRef, EMPTY_SLOT, NO_LEAF, NO_PARENT, Node, WIDTH};
use super::wide::WideCluster;
use crate::cluster::cone::angle;
use crate::cluster::{Cluster, MAX_FLUX};
use crate::light::{MIN_FLUX, UNLIMITED_RANGE};

/// Relative error of a sum of up to 2^31 f32 terms over a tree of depth 11 or more: each level adds
/// at most 3 roundings.
const FLUX_TOLERANCE: f32 = 1.0e-5;

/// Relative error of a packed flux, which has 8 bits.
const PACKED_FLUX_TOLERANCE: f32 = 1.0 / 256.0;

/// An invariant that [`LightTree::check`] found broken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[error("node {node}, slot {slot}: {what}")]
pub struct CheckError {
    /// The index of the node. The number of nodes if the whole tree is wrong.
    pub node: usize,
    /// The slot of the child. 0 if the node or the tree is wrong.
    pub slot: usize,
    /// What is wrong.
    pub what: &'static str,
}

impl CheckError {
    /// The stable code 800, see [`error`](crate::error).
    pub fn code(&self) -> u32 {
        800
    }
}

impl LightTree {
    /// Checks the tree's invariants: boxes contain their children's, caps and ranges cover them,
    /// fluxes add up, links agree in both directions, and every light has one leaf.
    ///
    /// # Errors
    /// The first broken invariant. None is ever broken unless this library has a bug or someone has forged
    /// a baked tree.
    ///
    /// O(nodes). The check of a frozen tree clones it.
    pub fn check(&self) -> Result<(), CheckError> {
        if self.is_frozen() {
            let thawed = self.thawed();
            let differs = |(node, (now, then)): (usize, (&Node, &Node))| (now != then).then_some(node);
            let fail = |node, what| Err(CheckError { node, slot: 0, what });
            if let Some(node) = self.nodes.iter().zip(&thawed.nodes).enumerate().find_map(differs) {
                return fail(node, "the node of the frozen tree differs from one made from its lights");
            }
            if self.root != thawed.root || self.sides != thawed.sides {
                return fail(
                    self.nodes.len(),
                    "the clusters of the frozen tree differ from those made from its lights",
                );
            }
            return thawed.check();
        }
        let wide_of_only_node = (self.nodes.len() == 1).then(|| [self.wide_of_only_node()]);
        let wide = match &wide_of_only_node {
            Some(wide) => &wide[..],
            None => self.state.wide(),
        };
        let mut has_leaf = vec![false; self.lights.len()];
        let mut reached = usize::from(!self.nodes.is_empty());
        let mut spares = 0;
        for (node, record) in self.nodes.iter().enumerate() {
            let fail = |slot, what| Err(CheckError { node, slot, what });
            if record.count() == 0 {
                spares += 1;
                continue;
            }
            if (node == 0) != (record.parent == NO_PARENT) {
                return fail(0, "the root has a parent, or another node has none");
            }
            if record.count() > WIDTH {
                return fail(0, "the number of children is above 8");
            }
            let mut lights = 0;
            for slot in record.count()..WIDTH {
                if record.children[slot] != EMPTY_SLOT || record.flux[slot] != 0 || wide[node].flux[slot] != 0.0 {
                    return fail(slot, "the slot is unused but not empty");
                }
            }
            for slot in 0..record.count() {
                let place = (node * WIDTH + slot) as u32;
                let exact = wide[node].get(slot);
                match record.child(slot) {
                    None => return fail(slot, "the slot is in use but has no child"),
                    Some(ChildRef::Leaf(light)) => {
                        let Some(has_leaf) = has_leaf.get_mut(light as usize) else {
                            return fail(slot, "the tree has no light of the leaf's index");
                        };
                        if std::mem::replace(has_leaf, true) {
                            return fail(slot, "the light has a second leaf");
                        }
                        if self.leaves[light as usize] != place {
                            return fail(slot, "the light's entry in `leaves` names another place");
                        }
                        lights += 1;
                        if self.lights[light as usize].is_removed() {
                            return fail(slot, "the leaf is that of a light that was removed");
                        }
                        if exact != self.lights[light as usize].cluster() {
                            return fail(slot, "the cluster at full precision is not the light's");
                        }
                    }
                    Some(ChildRef::Node(below)) => {
                        reached += 1;
                        let below = below as usize;
                        let Some(lower) = self.nodes.get(below) else {
                            return fail(slot, "the tree has no node of the child's index");
                        };
                        if below <= node {
                            return fail(slot, "the child does not lie behind the node");
                        }
                        if lower.parent != place {
                            return fail(slot, "the child's link to its parent names another place");
                        }
                        lights += self.light_counts[below];
                        let children = (0..lower.count()).map(|slot| wide[below].get(slot));
                        merge_fault(&exact, children).map_or(Ok(()), |what| fail(slot, what))?;
                    }
                }
                cover_fault(&record.cluster(slot), &exact).map_or(Ok(()), |what| fail(slot, what))?;
            }
            if lights != self.light_counts[node] {
                return fail(0, "the number of lights is not the sum of the children's");
            }
        }
        let fail = |what| Err(CheckError { node: self.nodes.len(), slot: 0, what });
        if reached + spares != self.nodes.len() {
            return fail("a node cannot be reached from the root");
        }
        for (index, light) in (0..).zip(&self.lights) {
            let (has_leaf, is_vacant) = (has_leaf[index as usize], self.edited.vacant().contains(&index));
            if has_leaf == light.is_removed() || (self.leaves[index as usize] == NO_LEAF) == has_leaf {
                return fail("a light has no leaf, or a removed light has one");
            }
            if is_vacant != light.is_removed() {
                return fail("the list of vacant indices is not that of the removed lights");
            }
        }
        if self.edited.vacant().last().is_some_and(|last| *last as usize >= self.lights.len()) {
            return fail("an index beyond the last is vacant");
        }
        let root = wide.first().copied().unwrap_or(WideCluster::EMPTY);
        if let Some(what) = merge_fault(&self.root, (0..WIDTH).map(|slot| root.get(slot))) {
            return fail(what);
        }
        let is_side = |(slot, side): (usize, &Cluster)| *side == root.get(slot);
        let children = self.nodes.first().map_or(0, Node::count);
        if !self.sides.is_empty() && self.sides.len() != children || !self.sides.iter().enumerate().all(is_side) {
            return fail("the sides are not the children of the root");
        }
        let total =
            self.lights.iter().map(|light| f64::from(light.cluster().flux)).sum::<f64>().min(f64::from(MAX_FLUX));
        let floors = f64::from(MIN_FLUX) * self.lights.len() as f64;
        if (total - f64::from(self.cluster().flux)).abs() > total * f64::from(FLUX_TOLERANCE) + floors {
            return fail("the tree's flux is not the sum of its lights' fluxes");
        }
        Ok(())
    }
}

/// What is wrong with a cluster that was merged from some children, if anything is.
fn merge_fault(outer: &Cluster, children: impl Iterator<Item = Cluster>) -> Option<&'static str> {
    let mut sum = 0.0;
    for child in children {
        sum += f64::from(child.flux);
        if let Some(what) = cover_fault(outer, &child) {
            return Some(what);
        }
    }
    let sum = sum.min(f64::from(MAX_FLUX));
    ((f64::from(outer.flux) - sum).abs() > sum * f64::from(FLUX_TOLERANCE))
        .then_some("the flux is not the sum of the children's fluxes")
}

/// Why a cluster does not cover another one, if it does not.
fn cover_fault(outer: &Cluster, inner: &Cluster) -> Option<&'static str> {
    if inner.flux <= 0.0 {
        return None;
    }
    if outer.flux <= 0.0 {
        return Some("the cluster is dark, but a light below it shines");
    }
    if outer.flux < inner.flux * (1.0 - PACKED_FLUX_TOLERANCE) {
        return Some("the flux is less than that of a child");
    }
    if !outer.aabb.contains(&inner.aabb) {
        return Some("the box does not contain the box of a child");
    }
    if outer.cos_half_angle > -1.0 && !covers_cap(outer, inner) {
        return Some("the cap does not cover the cap of a child");
    }
    if outer.range < inner.range.min(UNLIMITED_RANGE) {
        return Some("the range is shorter than that of a child");
    }
    let moments = [outer.flux, outer.variance].into_iter().chain(outer.mean.to_array()).chain(outer.axis.to_array());
    if moments.into_iter().any(|v| !v.is_finite()) || outer.variance < 0.0 {
        return Some("a moment is not finite, or the variance is negative");
    }
    None
}

/// Whether the cap of `outer` contains the cap of `inner`. A cap without an axis covers nothing.
fn covers_cap(outer: &Cluster, inner: &Cluster) -> bool {
    let half_angle = |c: &Cluster| f64::from(c.cos_half_angle.clamp(-1.0, 1.0)).acos();
    let axes = outer.axis.try_normalize().zip(inner.axis.try_normalize());
    inner.cos_half_angle > -1.0
        && axes.is_some_and(|(a, b)| f64::from(angle(a, b)) + half_angle(inner) <= half_angle(outer))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Light;

    fn tree() -> LightTree {
        let light = |i: usize| Light::spot(Vec3::splat(i as f32), Vec3::Y, 0.1, 0.3, Vec3::ONE).with_range(9.0);
        LightTree::build((0..100).map(light).collect())
    }

    /// The message for a tree that was broken on purpose.
    fn message(break_it: impl FnOnce(&mut LightTree)) -> String {
        let mut tree = tree();
        tree.check().expect("the tree is sound at first");
        break_it(&mut tree);
        let error = tree.check().expect_err("the tree is broken");
        assert_eq!(error.code(), 800);
        error.to_string()
    }

    #[test]
    fn each_broken_invariant_is_named_with_its_place() {
        assert_eq!(
            message(|tree| tree.nodes[0].parent = 8),
            "node 0, slot 0: the root has a parent, or another node has none"
        );
        assert!(message(|tree| tree.nodes[1].parent ^= 1).contains("slot 0: the child's link to its parent"));
        assert!(message(|tree| tree.leaves[7] ^= 1).ends_with("the light's entry in `leaves` names another place"));
        assert!(message(|tree| tree.nodes[0].flux[2] = 0).contains("slot 2: the cluster is dark, but"));
        assert!(message(|tree| tree.nodes[0].cap[3] = 0).contains("slot 3: the cap does not cover"));
        assert!(message(|tree| tree.nodes[0].range[1] = 0).contains("slot 1: the range is shorter"));
        assert!(message(|tree| tree.nodes[0].high[0][1] = 0).contains("slot 1: the box does not contain"));
        assert!(message(|tree| tree.root.range = 1.0).ends_with("slot 0: the range is shorter than that of a child"));
        assert!(
            message(|tree| tree.sides = [tree.root].into()).ends_with("the sides are not the children of the root")
        );
        assert!(
            message(|tree| tree.light_counts[0] += 1)
                .ends_with("the number of lights is not the sum of the children's")
        );
        assert!(message(|tree| tree.edited.set_vacant(3, true)).contains("the list of vacant indices is not that of"));
        assert!(message(|tree| tree.edited.set_vacant(100, true)).contains("an index beyond the last is vacant"));
        assert!(
            message(|tree| tree.lights[3] = Light::REMOVED).contains("the leaf is that of a light that was removed")
        );
        assert!(
            message(|tree| tree.state.data_mut().wide[0].axis = [[0.0; WIDTH]; 3]).contains("the cap does not cover")
        );
    }
}

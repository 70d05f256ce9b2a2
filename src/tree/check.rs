//! Checks that a tree is sound: its structure, which a load checks too, and its clusters. Every test of
//! trees does both after every step.
//!
//! A tree whose structure is sound has these properties, whatever file it was loaded from. They are all that
//! sampling, refits and rebuilds rely on, so none of them panics or loops, and the pmf of every light is the
//! chance with which it is sampled:
//!
//! - Each node but the root is the child of one node before it, and each light is one leaf.
//! - What a node stores is finite and within the limits that builds keep.
//! - The flux of a child is that of the nodes below, to rounding. So a child is dark exactly if all
//!   leaves below it are.
//!
//! Each node is checked against its children, its parent and the lists of the tree alone, so
//! threads check nodes independently.
//!
//! That the box and the cap of a child contain its lights is no part of the structure: the checksum proves it
//! for every file that this library has written, and whoever writes another file might as well
//! leave lights out. [`LightTree::check`] checks it too, in eight times the time of a load.

use super::LightTree;
use super::node::{ChildRef, EMPTY_SLOT, NO_LEAF, NO_PARENT, Node, WIDTH};
use super::pack::{packed_flux, packed_range};
use super::wide::WideCluster;
use crate::cluster::cone::angle;
use crate::cluster::{Aabb, Cluster, MAX_FLUX};
use crate::light::{Light, MAX_COORDINATE, MIN_FLUX, UNLIMITED_RANGE};

/// Relative error of a sum of up to 2^31 f32 terms over a tree of depth 11 or more: each level adds
/// at most 3 roundings.
const FLUX_TOLERANCE: f32 = 1.0e-5;

/// Relative error of a packed flux, which has 8 bits.
const PACKED_FLUX_TOLERANCE: f32 = 1.0 / 256.0;

/// The packed flux of a child and the sum of the packed fluxes below it were rounded to 8 bits each.
const PACKED_SUM_TOLERANCE: f32 = 2.1 / 256.0;

/// Rounding of the length of a unit vector and of the cosine of a cap, with its padding.
const UNIT_TOLERANCE: f32 = 1.0e-2;

/// Nodes that one thread checks in turn.
#[cfg(feature = "parallel")]
const NODES_PER_TASK: usize = 1024;

/// Largest absolute value of a coordinate of a box, in metres. The corner of a rectangle is at most
/// three times [`MAX_COORDINATE`] from the origin.
const MAX_CORNER: f32 = 4.0 * MAX_COORDINATE;

/// Largest biased exponent of a step of a node's grid, 2^27 m. 255 steps reach from one end of the
/// range of coordinates to the other.
const MAX_STEP_EXPONENT: u32 = 127 + 27;

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
        self.check_structure(self.lights.iter().filter(|light| light.is_removed()).count())?;
        if !self.is_frozen() {
            return self.check_clusters();
        }
        let thawed = self.thawed();
        let fail = |node, what| Err(CheckError { node, slot: 0, what });
        if let Some(node) = (0..self.nodes.len()).find(|node| self.nodes[*node] != thawed.nodes[*node]) {
            return fail(node, "the node of the frozen tree differs from one made from its lights");
        }
        if self.root != thawed.root || self.sides != thawed.sides {
            return fail(self.nodes.len(), "the clusters of the frozen tree differ from those made from its lights");
        }
        thawed.check_clusters()
    }

    /// Checks the structure of the tree; `removed` of its lights are [removed](Light::is_removed). Of several
    /// faults the one at the first node is returned. O(nodes), allocates nothing.
    pub(super) fn check_structure(&self, removed: usize) -> Result<(), CheckError> {
        let of_tree = |what| CheckError { node: self.nodes.len(), slot: 0, what };
        let fault = self.first_node_fault().or_else(|| self.whole_fault(removed).map(of_tree));
        fault.map_or(Ok(()), Err)
    }

    /// What is wrong with the first node that is wrong. Small trees are left to one thread.
    fn first_node_fault(&self) -> Option<CheckError> {
        let count = self.nodes.len();
        #[cfg(feature = "parallel")]
        if count > NODES_PER_TASK {
            use rayon::prelude::*;
            let nodes = (0..count).into_par_iter().with_min_len(NODES_PER_TASK);
            return nodes.find_map_first(|node| self.node_fault(node));
        }
        (0..count).find_map(|node| self.node_fault(node))
    }

    /// What is wrong with one node. Additions and removals of lights may leave nodes without children.
    fn node_fault(&self, index: usize) -> Option<CheckError> {
        let node = &self.nodes[index];
        let fail = |slot, what| Some(CheckError { node: index, slot, what });
        let count = node.count();
        if count == 0 && self.edited.is_changed() {
            return None;
        }
        if !self.is_linked(index, node) {
            return fail(0, "the node is not a child of the node that it names as its parent");
        }
        if let Some(what) = number_fault(node) {
            return fail(0, what);
        }
        if count == 0 || count > WIDTH {
            return fail(0, "the number of children is outside 1 to 8");
        }
        if let Some(slot) = (count..WIDTH).find(|slot| node.children[*slot] != EMPTY_SLOT || node.flux[*slot] != 0) {
            return fail(slot, "the slot is unused but not empty");
        }
        let mut lights = 0;
        for slot in 0..count {
            match self.lights_below(index, slot) {
                Ok(below) => lights += below,
                Err(what) => return fail(slot, what),
            }
        }
        if lights != u64::from(self.light_counts[index]) {
            return fail(0, "the number of lights is not the sum of the children's");
        }
        None
    }

    /// Whether a node is the child that its parent names, or the root.
    fn is_linked(&self, index: usize, node: &Node) -> bool {
        if index == 0 {
            return node.parent == NO_PARENT;
        }
        let (parent, slot) = (node.parent as usize / WIDTH, node.parent as usize % WIDTH);
        parent < index && slot < self.nodes[parent].count() && self.nodes[parent].children[slot] == index as u32
    }

    /// The number of lights below a child, which the tree states.
    ///
    /// # Errors
    /// What is wrong with the link to the child, or with the flux of a node.
    fn lights_below(&self, node: usize, slot: usize) -> Result<u64, &'static str> {
        let place = (node * WIDTH + slot) as u32;
        match self.nodes[node].child(slot) {
            None => Err("the slot is in use but has no child"),
            Some(ChildRef::Leaf(light)) => {
                let is_named = self.leaves.get(light as usize) == Some(&place);
                is_named.then_some(1).ok_or("the tree has no such light, or the light names another leaf")
            }
            Some(ChildRef::Node(below)) => {
                let below = below as usize;
                let lower = self.nodes.get(below).filter(|lower| below > node && lower.count() > 0);
                let lower = lower.ok_or("the child does not lie behind the node, or has no children")?;
                if lower.parent != place {
                    return Err("the child's link to its parent names another place");
                }
                if !agree(packed(&self.nodes[node], slot), packed_sum(lower)) {
                    return Err("the flux is not the sum of the children's fluxes");
                }
                Ok(self.light_counts[below].into())
            }
        }
    }

    /// What is wrong with the tree as a whole, whose nodes are sound.
    fn whole_fault(&self, removed: usize) -> Option<&'static str> {
        let vacant = self.vacant_indices();
        let is_vacant = |index: &u32| {
            let light = self.lights.get(*index as usize);
            light.is_some_and(Light::is_removed) && self.leaves[*index as usize] == NO_LEAF
        };
        if vacant.len() != removed || !vacant.iter().all(is_vacant) {
            return Some("a light has no leaf, or a removed light has one");
        }
        // Each leaf names a light that names it, so with this number every light has one leaf. A root
        // without children is that of a tree whose lights were all removed.
        let root = self.nodes.first().filter(|root| root.count() > 0);
        if root.map_or(0, |_| self.light_counts[0] as usize) != self.light_count() {
            return Some("the number of leaves is not that of lights");
        }
        let root = root.unwrap_or(&Node::EMPTY);
        if let Some(what) = cluster_fault(&self.root, packed_sum(root)) {
            return Some(what);
        }
        if !self.sides.is_empty() && self.sides.len() != root.count() {
            return Some("the sides are not the children of the root");
        }
        let side_fault = |(slot, side): (usize, &Cluster)| {
            let child = root.cluster(slot);
            let is_inside = side.flux <= 0.0 || child.aabb.contains(&side.aabb);
            cluster_fault(side, child.flux).or((!is_inside).then_some("a side is not inside its node"))
        };
        self.sides.iter().enumerate().find_map(side_fault)
    }

    /// Checks the clusters at full precision against the lights, and that the nodes, whose structure is sound, cover
    /// them. The tree is not frozen.
    fn check_clusters(&self) -> Result<(), CheckError> {
        let of_only_node = (self.nodes.len() == 1).then(|| [self.wide_of_only_node()]);
        let wide = of_only_node.as_ref().map_or(self.state.wide(), |wide| &wide[..]);
        for (node, record) in self.nodes.iter().enumerate().filter(|(_, record)| record.count() > 0) {
            for slot in 0..WIDTH {
                let exact = wide[node].get(slot);
                let fault = match record.child(slot) {
                    None => (exact.flux != 0.0).then_some("the slot is unused but not empty"),
                    Some(ChildRef::Leaf(light)) => (exact != self.lights[light as usize].cluster())
                        .then_some("the cluster at full precision is not the light's"),
                    Some(ChildRef::Node(below)) => merge_fault(&exact, &wide[below as usize]),
                };
                if let Some(what) = fault.or_else(|| cover_fault(&record.cluster(slot), &exact)) {
                    return Err(CheckError { node, slot, what });
                }
            }
        }
        let fail = |what| Err(CheckError { node: self.nodes.len(), slot: 0, what });
        let root = wide.first().unwrap_or(&WideCluster::EMPTY);
        if let Some(what) = merge_fault(&self.root, root) {
            return fail(what);
        }
        if !self.sides.iter().enumerate().all(|(slot, side)| *side == root.get(slot)) {
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

/// What is wrong with the numbers of a node.
fn number_fault(node: &Node) -> Option<&'static str> {
    let is_near = node.origin.iter().all(|v| v.abs() <= MAX_CORNER);
    let is_fine = [0, 8, 16].into_iter().all(|shift| node.steps >> shift & 0xff <= MAX_STEP_EXPONENT);
    if !is_near || !is_fine {
        return Some("the boxes are not within the range of coordinates");
    }
    // One loop for each field, so that the compiler compares all lanes at once.
    let (mut has_boxes, mut has_fluxes, mut has_ranges) = (true, true, true);
    for k in 0..3 {
        for i in 0..WIDTH {
            has_boxes &= node.low[k][i] <= node.high[k][i];
        }
    }
    let (least, most) = const { (packed_flux(MIN_FLUX), packed_flux(MAX_FLUX)) };
    for i in 0..WIDTH {
        has_fluxes &= (node.flux[i] == 0) | (node.flux[i] >= least) & (node.flux[i] <= most);
    }
    for i in 0..WIDTH {
        has_ranges &= (node.range[i] > 0) & (node.range[i] <= const { packed_range(UNLIMITED_RANGE) });
    }
    if !has_boxes {
        return Some("the least corner of a box is beyond the greatest");
    }
    if !has_fluxes {
        return Some("a flux is outside its limits");
    }
    (!has_ranges).then_some("a range is outside its limits")
}

/// The packed flux of a child.
fn packed(node: &Node, slot: usize) -> f32 {
    f32::from_bits(u32::from(node.flux[slot]) << 16)
}

/// The sum of the packed fluxes of all children.
fn packed_sum(node: &Node) -> f32 {
    let mut sum = 0.0;
    for slot in 0..WIDTH {
        sum += packed(node, slot);
    }
    if sum < MAX_FLUX { sum } else { MAX_FLUX }
}

/// Whether two fluxes are equal to rounding, and both zero if one is.
fn agree(a: f32, b: f32) -> bool {
    (a - b).abs() <= PACKED_SUM_TOLERANCE * b
}

/// What is wrong with a cluster whose flux should be about `flux`.
fn cluster_fault(cluster: &Cluster, flux: f32) -> Option<&'static str> {
    let Cluster {
        aabb: Aabb { min, max },
        flux: own,
        area_flux,
        punctual_flux,
        mean,
        variance,
        axis,
        cos_half_angle,
        range,
    } = *cluster;
    if !agree(own, flux) {
        return Some("the flux of a cluster is not that of its children");
    }
    let is_unit = |v: f32| v.abs() <= 1.0 + UNIT_TOLERANCE;
    let has_moments = mean.abs().max_element() <= MAX_CORNER && mean.is_finite() && variance.is_finite();
    let is_sound = has_moments
        && variance >= 0.0
        && (0.0..=MAX_FLUX).contains(&area_flux)
        && (0.0..=MAX_FLUX).contains(&punctual_flux)
        && is_unit(axis.length())
        && is_unit(cos_half_angle)
        && range >= 0.0;
    if !is_sound {
        return Some("a number of a cluster is outside its limits");
    }
    let has_box = min.cmple(max).all() && min.min_element() >= -MAX_CORNER && max.max_element() <= MAX_CORNER;
    // Other than its box, a dark cluster has nothing that anything reads.
    let is_right = if own > 0.0 { has_box && range > 0.0 } else { cluster.aabb == Aabb::EMPTY && own == 0.0 };
    (!is_right).then_some("the box or the range of a cluster is outside its limits")
}

/// What is wrong with a cluster that was merged from eight lanes, if anything is.
fn merge_fault(outer: &Cluster, lanes: &WideCluster) -> Option<&'static str> {
    let mut sum = 0.0;
    for child in (0..WIDTH).map(|lane| lanes.get(lane)) {
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
            "node 0, slot 0: the node is not a child of the node that it names as its parent"
        );
        assert!(message(|tree| tree.nodes[1].parent ^= 1).contains("slot 0: the child's link to its parent"));
        assert!(message(|tree| tree.leaves[7] ^= 1).ends_with("the light names another leaf"));
        assert!(message(|tree| tree.nodes[0].flux[2] = 0).contains("slot 2: the flux is not the sum"));
        assert!(message(|tree| tree.nodes[0].cap[3] = 0).contains("slot 3: the cap does not cover"));
        assert!(message(|tree| tree.nodes[0].range[1] = 1).contains("slot 1: the range is shorter"));
        assert!(
            message(|tree| tree.nodes[0].high[0][1] = tree.nodes[0].low[0][1])
                .contains("slot 1: the box does not contain")
        );
        assert!(message(|tree| tree.root.range = 1.0).ends_with("slot 0: the range is shorter than that of a child"));
        assert!(
            message(|tree| tree.sides = [tree.root].into()).ends_with("the sides are not the children of the root")
        );
        assert!(
            message(|tree| tree.light_counts[0] += 1)
                .ends_with("the number of lights is not the sum of the children's")
        );
        assert!(message(|tree| tree.edited.set_vacant(3, true)).contains("a light has no leaf, or a removed"));
        assert!(message(|tree| tree.edited.set_vacant(100, true)).contains("a light has no leaf, or a removed"));
        assert!(message(|tree| tree.lights[3] = Light::REMOVED).contains("a light has no leaf, or a removed"));
        let lights = |tree: &mut LightTree| tree.lights[3].emission *= 2.0;
        assert!(message(lights).contains("the cluster at full precision is not the light's"));
        assert!(
            message(|tree| tree.state.data_mut().wide[0].axis = [[0.0; WIDTH]; 3]).contains("the cap does not cover")
        );
    }
}

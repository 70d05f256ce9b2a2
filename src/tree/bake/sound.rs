//! Checks that the nodes of a loaded tree are a tree over its lights and can be sampled.
//!
//! Whatever the bytes were, a tree that passes has these properties. They are all that sampling,
//! refits and rebuilds rely on, so none of them panics or loops, and the pmf of every light is the
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
//! That the box and the cap of a child contain its lights is not checked: the checksum proves it
//! for every file that this library has written, and whoever writes another file might as well
//! leave lights out. [`LightTree::check`] checks it too, in eight times the time of a load.

use super::super::LightTree;
use crate::cluster::bounds::Aabb;
use crate::cluster::{Cluster, MAX_FLUX};
use crate::light::{MAX_COORDINATE, MIN_FLUX, UNLIMITED_RANGE};
use crate::tree::check::CheckError;
use crate::tree::node::{ChildRef, EMPTY_SLOT, NO_PARENT, Node, WIDTH};
use crate::tree::pack::{packed_flux, packed_range};

/// Nodes that one thread checks in turn.
#[cfg(feature = "parallel")]
const NODES_PER_TASK: usize = 1024;

/// Largest absolute value of a coordinate of a box, in metres. The corner of a rectangle is at most
/// three times [`MAX_COORDINATE`] from the origin.
const MAX_CORNER: f32 = 4.0 * MAX_COORDINATE;

/// Largest biased exponent of a step of a node's grid, 2^27 m. 255 steps reach from one end of the
/// range of coordinates to the other.
const MAX_STEP_EXPONENT: u32 = 127 + 27;

/// The flux of a child and the sum of the fluxes below it were rounded to 8 bits each.
const FLUX_TOLERANCE: f32 = 2.1 / 256.0;

/// Rounding of the length of a unit vector and of the cosine of a cap, with its padding.
const UNIT_TOLERANCE: f32 = 1.0e-2;

impl LightTree {
    /// What is wrong with a tree that was loaded, if anything is; `removed` of its lights have the
    /// record of a removed light. Of several faults the one at the
    /// first node. O(nodes), allocates nothing.
    pub(super) fn loading_fault(&self, removed: usize) -> Option<CheckError> {
        let of_tree = |what| CheckError { node: self.nodes.len(), slot: 0, what };
        self.first_node_fault().or_else(|| self.whole_fault(removed).map(of_tree))
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

    /// What is wrong with one node.
    fn node_fault(&self, index: usize) -> Option<CheckError> {
        let node = &self.nodes[index];
        let fail = |slot, what| Some(CheckError { node: index, slot, what });
        if !self.is_linked(index, node) {
            return fail(0, "the node is not a child of the node that it names as its parent");
        }
        if let Some(what) = grid_fault(node) {
            return fail(0, what);
        }
        let count = node.count();
        if count == 0 || count > WIDTH {
            return fail(0, "the number of children is outside 1 to 8");
        }
        if let Some(slot) = (count..WIDTH).find(|slot| node.children[*slot] != EMPTY_SLOT || node.flux[*slot] != 0) {
            return fail(slot, "the slot is unused but not empty");
        }
        let mut lights = 0;
        for slot in 0..count {
            match node.child(slot) {
                None => return fail(slot, "the slot is in use but has no child"),
                Some(ChildRef::Leaf(light)) => {
                    if self.leaves.get(light as usize) != Some(&((index * WIDTH + slot) as u32)) {
                        return fail(slot, "the tree has no such light, or the light names another leaf");
                    }
                    lights += 1;
                }
                Some(ChildRef::Node(below)) => {
                    let below = below as usize;
                    let Some(lower) = self.nodes.get(below).filter(|_| below > index) else {
                        return fail(slot, "the child does not lie behind the node");
                    };
                    if lower.parent as usize != index * WIDTH + slot {
                        return fail(slot, "the child's link to its parent names another place");
                    }
                    if !agree(flux(node, slot), sum_of_flux(lower)) {
                        return fail(slot, "the flux is not the sum of the children's fluxes");
                    }
                    lights += u64::from(self.light_counts[below]);
                }
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
        parent < index && self.nodes[parent].children[slot] == index as u32
    }

    /// What is wrong with the tree as a whole, whose nodes are sound.
    fn whole_fault(&self, removed: usize) -> Option<&'static str> {
        let vacant = self.vacant_indices();
        if vacant.len() != removed || !vacant.iter().all(|index| self.lights[*index as usize].is_removed()) {
            return Some("a light has no leaf, or a removed light has one");
        }
        let Some(root) = self.nodes.first() else {
            return if self.light_count() > 0 || !self.sides.is_empty() {
                Some("there are lights or sides without a node")
            } else {
                cluster_fault(&self.root, 0.0)
            };
        };
        // Each leaf names a light that names it, so with this number every light has one leaf.
        if self.light_counts[0] as usize != self.light_count() {
            return Some("the number of leaves is not that of lights");
        }
        if let Some(what) = cluster_fault(&self.root, sum_of_flux(root)) {
            return Some(what);
        }
        if !self.sides.is_empty() && self.sides.len() != root.count() {
            return Some("the sides are not the children of the root");
        }
        let side_fault = |(slot, side)| {
            let child = root.cluster(slot);
            let fault = cluster_fault(side, child.flux);
            let is_inside = side.flux <= 0.0 || child.aabb.contains(&side.aabb);
            fault.or((!is_inside).then_some("a side is not inside its node"))
        };
        self.sides.iter().enumerate().find_map(side_fault)
    }
}

/// What is wrong with the numbers of a node.
fn grid_fault(node: &Node) -> Option<&'static str> {
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

/// The flux of a child.
fn flux(node: &Node, slot: usize) -> f32 {
    f32::from_bits(u32::from(node.flux[slot]) << 16)
}

/// The flux of all children.
fn sum_of_flux(node: &Node) -> f32 {
    let mut sum = 0.0;
    for slot in 0..WIDTH {
        sum += flux(node, slot);
    }
    if sum < MAX_FLUX { sum } else { MAX_FLUX }
}

/// Whether two fluxes are equal to rounding, and both zero if one is.
fn agree(a: f32, b: f32) -> bool {
    (a - b).abs() <= FLUX_TOLERANCE * b
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

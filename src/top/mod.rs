//! The top level: one tree over the parts of all instances, built anew after every change.
//!
//! Twin of the stages in `plan/top.rs`, which build the same tree on the GPU; a test there compares
//! both. The parts are sorted along a curve through space (Lauterbach et al. 2009) and cut into
//! pieces of neighbours. Each piece is split by cost (`split.rs`) into groups, and each group
//! becomes a node. The nodes of all pieces, still in the order of the curve, are cut into pieces
//! again, and so on. The last few units become a tree by cost from the root down.
//!
//! Differs from trees along a curve: the curve only decides which units are split together. Each
//! step is one dispatch over pieces that fit into a workgroup, so no workgroup waits for another
//! (docs/decisions.md, 4).

mod split;

use crate::bounds::Aabb;
use crate::cluster::Cluster;
use crate::curve::{Curve, NO_KEY};
use crate::part::{PART, PART_BITS, Part};
use crate::tree::{Children, EMPTY_SLOT, NO_PARENT, Node, Target, WIDTH, WideCluster};
#[cfg(feature = "gpu-plan")]
pub(crate) use split::{AXIS_STEPS, COST_SLACK, CUT_BITS, CUTS, LAST_CELL, ROUNDS};
use split::{PiecePart, split};

/// Units that are split together, at most: as many as a workgroup has memory for. Half as many cost
/// 15 % more noise.
pub(crate) const PIECE: usize = 512;

/// A piece begins where the curve enters its largest cell, at most this many units before or after
/// an even share. Ragged borders cost 10 % more noise.
pub(crate) const WINDOW: usize = 64;

/// The largest mean number of units of a piece.
pub(crate) const SHARE: usize = PIECE - 2 * WINDOW;

/// Up to this many units become the upper part of the tree at once.
pub(crate) const ROOT_UNITS: usize = 256;

/// A tree over parts of instances.
#[derive(Clone, Debug)]
pub(crate) struct TopLevel {
    /// The root first.
    pub nodes: Vec<Node>,
    /// The parts of all instances, in the order of their slots.
    parts: Vec<Part>,
    /// For each part the place (`node * WIDTH + slot`) of its leaf; [`NO_PARENT`] for a dark part.
    places: Vec<u32>,
    /// For each instance slot the first of its parts, and the number of all parts.
    first_parts: Vec<u32>,
    /// For each child of each node the union of the masks of all instances below it. Empty if all
    /// instances have all bits.
    pub masks: Vec<[u32; WIDTH]>,
}

/// A part or a node that has no parent yet.
#[derive(Clone, Copy)]
struct Unit {
    cluster: Cluster,
    kind: UnitKind,
}

#[derive(Clone, Copy)]
enum UnitKind {
    /// The number of a part.
    Part(u32),
    /// The index of a node.
    Node(u32),
}

/// The largest number of units that a piece of `count` units may leave. A piece that would leave
/// more is cut into groups of eight instead. So each round leaves at most a quarter of the units.
pub(crate) const fn most_units(count: usize) -> usize {
    count.div_ceil(4)
}

/// The first unit of a piece; for `piece == pieces`, the number of units. `keys` are the units'
/// places on the curve.
fn piece_start(keys: &[u32], pieces: usize, piece: usize) -> usize {
    let even = piece * (keys.len() / pieces) + piece.min(keys.len() % pieces);
    if piece == 0 || piece == pieces {
        return even;
    }
    let first = even - WINDOW;
    // Choose the highest digit that changes, then the nearest place, then the last.
    let rank = |step: &usize| {
        let unit = first + step;
        let digit = u32::BITS - (keys[unit] ^ keys[unit - 1]).leading_zeros();
        (digit, WINDOW - unit.abs_diff(even), *step)
    };
    first + (0..2 * WINDOW).max_by_key(rank).unwrap_or(WINDOW)
}

impl TopLevel {
    /// Builds a tree over parts and their clusters, in the order of the slots of their instances,
    /// of which there are `slots`. O(n log n).
    pub fn build(parts: &[(Part, Cluster)], slots: usize) -> Self {
        let mut top = Self::without_nodes(parts, slots);
        let bounds = Aabb::around(parts.iter().map(|(_, c)| c).filter(|c| c.flux > 0.0).map(|c| c.mean));
        let curve = Curve::new(&bounds);
        let lit = parts.iter().zip(0..).filter(|((_, c), _)| c.flux > 0.0);
        let mut order: Vec<(u32, u32)> = lit.map(|((_, c), part)| (curve.key(c.mean), part)).collect();
        order.sort_unstable();
        debug_assert!(order.last().is_none_or(|(key, _)| *key < NO_KEY));
        let unit = |(_, part): &(u32, u32)| Unit { cluster: parts[*part as usize].1, kind: UnitKind::Part(*part) };
        let mut units: Vec<Unit> = order.iter().map(unit).collect();
        while units.len() > ROOT_UNITS {
            let mut left = Vec::with_capacity(units.len() / 4);
            for groups in groups_of_pieces(&units, &curve) {
                for group in groups {
                    left.push(if let [alone] = group[..] { alone } else { top.add(&group, None) });
                }
            }
            units = left;
        }
        top.add_upper(&units);
        top
    }

    /// Stores the masks of all children. `mask_of` returns the mask of the instance in a slot.
    /// O(nodes).
    pub fn set_masks(&mut self, mask_of: impl Fn(u32) -> u32) {
        self.masks = vec![[0; WIDTH]; self.nodes.len()];
        // Children come before their parents, and the root is the parent of the last ones.
        for node in (1..self.nodes.len()).chain([0]) {
            self.masks[node] = std::array::from_fn(|slot| match self.nodes[node].target(slot) {
                Some(Target::Leaf(leaf)) => self.part(leaf).map_or(0, |part| mask_of(part.slot)),
                Some(Target::Node(child)) => self.masks[child as usize].iter().fold(0, |all, mask| all | mask),
                None => 0,
            });
        }
    }

    /// The lists of all parts, and a root without children.
    fn without_nodes(parts: &[(Part, Cluster)], slots: usize) -> Self {
        let mut first_parts = Vec::with_capacity(slots + 1);
        for (index, (part, _)) in parts.iter().enumerate() {
            first_parts.resize(first_parts.len().max(part.slot as usize + 1), index as u32);
        }
        first_parts.resize(slots + 1, parts.len() as u32);
        let parts: Vec<Part> = parts.iter().map(|(part, _)| *part).collect();
        let places = vec![NO_PARENT; parts.len()];
        Self { nodes: vec![Node::EMPTY], places, parts, first_parts, masks: Vec::new() }
    }

    /// The part that a leaf is. `leaf` are the bits of its target below [`LEAF`]. `None` if there
    /// is no such part.
    pub fn part(&self, leaf: u32) -> Option<Part> {
        if leaf & PART == 0 {
            return Some(Part { slot: leaf, target: Target::Node(0) });
        }
        self.parts.get((leaf & PART_BITS) as usize).copied()
    }

    /// The places of the leaves of an instance's parts, in the order of the parts. Empty for a slot
    /// that there is not.
    pub fn places(&self, slot: u32) -> &[u32] {
        let slot = slot as usize;
        let [first, end] = [slot, slot + 1].map(|i| self.first_parts.get(i).map_or(self.places.len(), |p| *p as usize));
        &self.places[first..end]
    }

    /// Makes a node of some units, at `index` or at the end, and links them to it. Returns the node
    /// as a unit.
    fn add(&mut self, units: &[Unit], index: Option<u32>) -> Unit {
        let index = index.unwrap_or_else(|| {
            self.nodes.push(Node::EMPTY);
            self.nodes.len() as u32 - 1
        });
        let mut wide = WideCluster::EMPTY;
        let mut targets = [EMPTY_SLOT; WIDTH];
        for (slot, unit) in units.iter().enumerate() {
            let place = index * WIDTH as u32 + slot as u32;
            wide.set(slot, &unit.cluster);
            match unit.kind {
                UnitKind::Part(part) => {
                    self.places[part as usize] = place;
                    targets[slot] = self.parts[part as usize].leaf(part);
                }
                UnitKind::Node(node) => {
                    self.nodes[node as usize].parent = place;
                    targets[slot] = node;
                }
            }
        }
        let cluster = wide.merged().cluster;
        let node = &mut self.nodes[index as usize];
        node.targets = targets;
        node.parent = NO_PARENT;
        node.pack(&wide, &cluster.aabb, WIDTH);
        Unit { cluster, kind: UnitKind::Node(index) }
    }

    /// Makes the upper part of the tree, from the root down.
    fn add_upper(&mut self, units: &[Unit]) {
        let split = split(units.iter().map(|unit| &unit.cluster));
        let in_order: Vec<Unit> = split.order.iter().map(|unit| units[*unit]).collect();
        self.add_part(&in_order, &split.parts, split.parts[0], Some(0));
    }

    /// Makes the node of one of `parts` and the nodes below it. `units` are in the order of the
    /// parts.
    fn add_part(&mut self, units: &[Unit], parts: &[PiecePart], part: PiecePart, index: Option<u32>) -> Unit {
        let children = Children::choose(part, |_, part| Some(part.halves?.map(|half| parts[half])));
        let mut below = Vec::with_capacity(WIDTH);
        for (child, is_open) in children.iter() {
            if is_open || child.count <= 1 {
                below.extend_from_slice(&units[child.first..child.first + child.count]);
            } else {
                below.push(self.add_part(units, parts, *child, None));
            }
        }
        self.add(&below, index)
    }
}

/// Splits the units of each piece into groups, one for each node. All in the order of the curve.
fn groups_of_pieces(units: &[Unit], curve: &Curve) -> Vec<Vec<Vec<Unit>>> {
    let keys: Vec<u32> = units.iter().map(|unit| curve.key(unit.cluster.mean)).collect();
    let pieces = units.len().div_ceil(SHARE);
    let groups_of = |piece: usize| {
        let units = &units[piece_start(&keys, pieces, piece)..piece_start(&keys, pieces, piece + 1)];
        let split = split(units.iter().map(|unit| &unit.cluster));
        let mut leaves: Vec<PiecePart> = split.parts.into_iter().filter(|part| part.halves.is_none()).collect();
        leaves.sort_unstable_by_key(|part| part.first);
        let group = |places: &[usize]| places.iter().map(|place| units[*place]).collect::<Vec<Unit>>();
        if leaves.len() > most_units(units.len()) {
            return split.order.chunks(WIDTH).map(group).collect();
        }
        leaves.iter().map(|part| group(&split.order[part.first..part.first + part.count])).collect::<Vec<_>>()
    };
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        (0..pieces).into_par_iter().map(groups_of).collect()
    }
    #[cfg(not(feature = "parallel"))]
    (0..pieces).map(groups_of).collect()
}

#[cfg(test)]
mod tests;

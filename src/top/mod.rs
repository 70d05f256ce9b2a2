//! The top level: one tree over all instances, made anew whenever one of them moved.
//!
//! Twin of the stages in `gpu/top.rs`, which builds the same tree on the GPU; a test there compares them. Instances are
//! sorted along a curve through space (Lauterbach et al. 2009) and cut into pieces of neighbours. Each piece is split
//! by cost (`split.rs`), and what ends up together becomes a node; the nodes of all pieces, still in the curve's order,
//! are cut into pieces again, and so on, until few units are left, which become a tree by cost from the root down.
//! Differs from trees along a curve: it decides only who is looked at together. Every step is one dispatch over pieces
//! that fit into a workgroup, so nothing waits for other workgroups (docs/decisions.md, 4).

mod split;

use crate::bounds::Aabb;
use crate::cluster::Cluster;
use crate::curve::{Curve, NO_KEY};
use crate::tree::{EMPTY_SLOT, LEAF, NO_PARENT, Node, WIDTH, WideCluster};
pub(crate) use split::COST_SLACK;
#[cfg(feature = "gpu")]
pub(crate) use split::{AXIS_STEPS, CUT_BITS, CUTS, LAST_CELL, MIN_ORIENTATION, ROUNDS};
use split::{Part, split};

/// Units that are split together: what a workgroup has memory for. Half as many cost 15 % of noise.
pub(crate) const PIECE: usize = 512;

/// Pieces begin where the curve enters the largest cell within so many units before or behind an even share: ragged
/// borders cost 10 % of noise.
pub(crate) const WINDOW: usize = 64;

/// Units of a piece on average, at most.
pub(crate) const SHARE: usize = PIECE - 2 * WINDOW;

/// So many units become the upper part of the tree at once.
pub(crate) const ROOT_UNITS: usize = 256;

/// A tree over instance slots.
#[derive(Clone, Debug)]
pub(crate) struct TopLevel {
    /// The root first.
    pub nodes: Vec<Node>,
    /// For each instance slot the place (`node * WIDTH + slot`) of its leaf.
    pub places: Vec<u32>,
}

/// An instance or a node that hangs nowhere yet.
#[derive(Clone, Copy)]
struct Unit {
    cluster: Cluster,
    /// As in [`Node::targets`].
    target: u32,
}

/// Most units that a piece may leave; one with more is cut into eights instead. So every round leaves at most a
/// quarter.
pub(crate) const fn most_units(count: usize) -> usize {
    count.div_ceil(4)
}

/// First unit of a piece; of the piece past the last, the number of units. `keys` are places on the curve.
fn piece_start(keys: &[u32], pieces: usize, piece: usize) -> usize {
    let even = piece * (keys.len() / pieces) + piece.min(keys.len() % pieces);
    if piece == 0 || piece == pieces {
        return even;
    }
    let first = even - WINDOW;
    // The highest digit that changes, then the nearest, then the last.
    let rank = |step: &usize| {
        let unit = first + step;
        let digit = u32::BITS - (keys[unit] ^ keys[unit - 1]).leading_zeros();
        (digit, WINDOW - unit.abs_diff(even), *step)
    };
    first + (0..2 * WINDOW).max_by_key(rank).unwrap_or(WINDOW)
}

impl TopLevel {
    /// Builds over the instances of all slots; those of slots without one are dark. O(n log n).
    pub fn build(instances: &[Cluster]) -> Self {
        let mut top = Self { nodes: vec![Node::EMPTY], places: vec![0; instances.len()] };
        let bounds = Aabb::around(instances.iter().filter(|c| c.flux > 0.0).map(|c| c.mean));
        let curve = Curve::new(&bounds);
        let lit = instances.iter().zip(0..).filter(|(c, _)| c.flux > 0.0);
        let mut order: Vec<(u32, u32)> = lit.map(|(c, slot)| (curve.key(c.mean), slot)).collect();
        order.sort_unstable();
        debug_assert!(order.last().is_none_or(|(key, _)| *key < NO_KEY));
        let unit = |(_, slot): &(u32, u32)| Unit { cluster: instances[*slot as usize], target: LEAF | slot };
        let mut units: Vec<Unit> = order.iter().map(unit).collect();
        while units.len() > ROOT_UNITS {
            let mut above = Vec::with_capacity(units.len() / 4);
            for groups in grouped(&units, &curve) {
                for group in groups {
                    above.push(if let [alone] = group[..] { alone } else { top.add(&group, None) });
                }
            }
            units = above;
        }
        top.add_root(&units);
        top
    }

    /// Makes a node of units, at an index or a new one; tells them where they hang.
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
            targets[slot] = unit.target;
            if unit.target & LEAF != 0 {
                self.places[(unit.target & !LEAF) as usize] = place;
            } else {
                self.nodes[unit.target as usize].parent = place;
            }
        }
        let cluster = wide.merged().cluster;
        let node = &mut self.nodes[index as usize];
        node.targets = targets;
        node.parent = NO_PARENT;
        node.pack(&wide, &cluster.aabb, WIDTH);
        Unit { cluster, target: index }
    }

    /// The upper part of the tree.
    fn add_root(&mut self, units: &[Unit]) {
        let split = split(units.iter().map(|unit| &unit.cluster));
        let in_order: Vec<Unit> = split.order.iter().map(|unit| units[*unit]).collect();
        self.add_part(&in_order, &split.parts, 0, Some(0));
    }

    fn add_part(&mut self, units: &[Unit], parts: &[Part], part: usize, index: Option<u32>) -> Unit {
        let mut children = Vec::with_capacity(WIDTH);
        for Child { part, is_open } in children_of(parts, part) {
            let Part { first, count, .. } = parts[part];
            if is_open || count == 1 {
                children.extend_from_slice(&units[first..first + count]);
            } else {
                children.push(self.add_part(units, parts, part, None));
            }
        }
        self.add(&children, index)
    }
}

/// A part below a node.
#[derive(Clone, Copy)]
struct Child {
    part: usize,
    /// Its units hang in the node themselves.
    is_open: bool,
}

/// What hangs in the node of a part, in order: as `Groups` in `tree/shape`, the costliest part that no node can hold is
/// replaced by its halves, while there is room; then small ones are opened.
fn children_of(parts: &[Part], whole: usize) -> Vec<Child> {
    let mut children = vec![Child { part: whole, is_open: parts[whole].count <= WIDTH }];
    while children.len() < WIDTH {
        let mut costliest: Option<(usize, [usize; 2])> = None;
        let rank = |child: usize| (parts[children[child].part].cost >> COST_SLACK, parts[children[child].part].count);
        for (child, Child { part, .. }) in children.iter().enumerate() {
            if let Some(halves) = parts[*part].halves
                && costliest.is_none_or(|(best, _)| rank(child) > rank(best))
            {
                costliest = Some((child, halves));
            }
        }
        let Some((child, halves)) = costliest else { break };
        children.splice(child..=child, halves.map(|part| Child { part, is_open: false }));
    }
    let mut room = WIDTH - children.len();
    let closed = |child: &Child| !child.is_open && parts[child.part].count > 1;
    while let Some(child) =
        (0..children.len()).filter(|i| closed(&children[*i])).min_by_key(|i| parts[children[*i].part].count)
        && parts[children[child].part].count - 1 <= room
    {
        room -= parts[children[child].part].count - 1;
        children[child].is_open = true;
    }
    children
}

/// The groups of each piece, in order.
fn grouped(units: &[Unit], curve: &Curve) -> Vec<Vec<Vec<Unit>>> {
    let keys: Vec<u32> = units.iter().map(|unit| curve.key(unit.cluster.mean)).collect();
    let pieces = units.len().div_ceil(SHARE);
    let group = |piece: usize| {
        let units = &units[piece_start(&keys, pieces, piece)..piece_start(&keys, pieces, piece + 1)];
        let split = split(units.iter().map(|unit| &unit.cluster));
        let mut ends: Vec<Part> = split.parts.into_iter().filter(|part| part.halves.is_none()).collect();
        ends.sort_unstable_by_key(|part| part.first);
        let of = |places: &[usize]| places.iter().map(|place| units[*place]).collect::<Vec<Unit>>();
        if ends.len() > most_units(units.len()) {
            return split.order.chunks(WIDTH).map(of).collect();
        }
        ends.iter().map(|part| of(&split.order[part.first..part.first + part.count])).collect::<Vec<_>>()
    };
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        (0..pieces).into_par_iter().map(group).collect()
    }
    #[cfg(not(feature = "parallel"))]
    (0..pieces).map(group).collect()
}

#[cfg(test)]
mod tests;

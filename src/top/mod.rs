//! The top level: one tree over the parts of all instances, built anew after every change.
//!
//! Twin of the stages in `plan/top.rs`, which build the same tree on the GPU; a test there compares
//! both. The parts are sorted in an order in space (`tree/space_order.rs`) and cut into
//! pieces of neighbours. Each piece is split by cost (`split.rs`). Its few costliest parts are the
//! units of the next pass, and all below them becomes nodes. The units of all pieces, still in the
//! order in space, are cut into pieces again, and so on. The last piece is the whole tree.
//!
//! Differs from linear BVHs (Lauterbach et al. 2009): the order only decides which units are split together. Each
//! pass works on pieces that fit into a workgroup, so no workgroup waits for another
//! (docs/decisions.md, 66).

pub(crate) mod masks;
mod split;

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crate::cluster::Cluster;
use crate::instance::part::{PART, PART_BITS, Part};
use crate::tree::space_order::{NO_KEY, SpaceOrder, identity};
use crate::tree::{ChildRef, Children, EMPTY_SLOT, NO_PARENT, Node, WIDTH, WideCluster};
use masks::{MaskShares, NodeMasks};
#[cfg(feature = "gpu-plan")]
pub(crate) use split::{BINS, CELL_BITS, COST_SLACK, DIAGONAL_SHARE, FLUX_BITS, MAX_ZOOM, TINY_SHARE};
#[cfg(any(feature = "gpu-plan", test))]
pub(crate) use split::{LARGE_HALVINGS, LARGE_ROUNDS, MAX_CUTS, MAX_TINY, SMALL, SMALL_HALVINGS, SMALL_ROUNDS};
use split::{PiecePart, SplitPiece};

/// Units that are split together, at most: as many as a workgroup has memory for, and as nine bits
/// count.
pub(crate) const PIECE: usize = 511;

/// The largest mean number of units of a piece. A piece begins anywhere between the middles of two
/// even shares, so it is at most twice as large. It has at least [`UNITS_PER_NODE`] units.
pub(crate) const SHARE: usize = PIECE.div_ceil(2);

/// The number of units that a piece leaves, unless there are few pieces. Fewer hide from the next
/// pass what it could split; more make more passes (docs/decisions.md, 66).
pub(crate) const LEFT: usize = 5;

/// The next [`TopLevel::id`].
static NEXT_ID: AtomicU64 = AtomicU64::new(1);

/// A tree over parts of instances.
#[derive(Clone, Debug)]
pub(crate) struct TopLevel {
    /// Tells top levels apart; not 0.
    pub id: u64,
    /// The root first.
    pub nodes: Vec<Node>,
    /// The parts of all instances, in the order of their slots.
    parts: Vec<Part>,
    /// For each part the place (`node * WIDTH + slot`) of its leaf; [`NO_PARENT`] for a dark part.
    places: Vec<u32>,
    /// For each instance slot the first of its parts, and the number of all parts.
    first_parts: Vec<u32>,
    /// The masks below each node. Empty if all instances have all bits.
    pub masks: Vec<NodeMasks>,
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
    /// The number of a node within its piece.
    InPiece(u32),
}

impl UnitKind {
    /// The same unit once the nodes of its piece begin at `first`.
    fn above(self, first: u32) -> Self {
        match self {
            Self::InPiece(number) => Self::Node(first + number),
            other => other,
        }
    }
}

/// The largest number of units that each of `pieces` pieces leaves. Few pieces leave as many as the
/// last piece can split.
pub(crate) const fn units_left(pieces: usize) -> usize {
    let share = PIECE / pieces;
    if share > LEFT { share } else { LEFT }
}

/// Pieces have at most one node for this many units.
pub(crate) const UNITS_PER_NODE: usize = 4;

/// An upper bound for the number of nodes of a piece of `count` units. The piece that is the whole
/// tree may have one node more. The bounds of several pieces add up to at most the bound of all their
/// units. The test
/// `no_piece_has_more_cuts_or_nodes_than_there_is_room_for` tries all pieces.
#[cfg(any(feature = "gpu-plan", test))]
pub(crate) const fn most_nodes(count: usize) -> usize {
    count / UNITS_PER_NODE
}

/// The first unit of a piece; for `piece == pieces`, the number of units. `keys` are the units'
/// places in the order in space.
///
/// It is where the order enters its largest cell within half a share. Any place is within half a share
/// of a start, so what lies beyond the border of a large cell does not hide in the piece before it.
fn piece_start(keys: &[u32], pieces: usize, piece: usize) -> usize {
    let share = keys.len() / pieces;
    let even = piece * share + piece.min(keys.len() % pieces);
    if piece == 0 || piece == pieces {
        return even;
    }
    let half = (share - UNITS_PER_NODE) / 2;
    let first = even - half;
    // Choose the highest digit that changes, then the nearest place, then the last.
    let rank = |step: &usize| {
        let unit = first + step;
        let digit = u32::BITS - (keys[unit] ^ keys[unit - 1]).leading_zeros();
        (digit, half - unit.abs_diff(even), *step)
    };
    first + (0..2 * half).max_by_key(rank).unwrap_or(half)
}

impl TopLevel {
    /// Builds a tree over parts and their clusters, in the order of the slots of their instances,
    /// of which there are `slots`. O(n log n).
    pub fn build(parts: &[(Part, Cluster)], slots: usize) -> Self {
        let mut top = Self::without_nodes(parts, slots);
        let lit = parts.iter().zip(0..).filter(|((_, c), _)| c.flux > 0.0);
        let number = |slot: u32, index: u32| index - top.first_parts[slot as usize];
        let means = lit.map(|((part, c), index)| (identity(part.slot, number(part.slot, index)), c.mean));
        let space = SpaceOrder::new(means.clone(), means.count().div_ceil(SHARE));
        let keys = map_all(parts, |(_, c)| if c.flux > 0.0 { space.key(c.mean) } else { NO_KEY });
        let mut order: Vec<(u32, u32)> = keys.into_iter().zip(0..).filter(|(key, _)| *key < NO_KEY).collect();
        sort(&mut order);
        let unit = |(_, part): &(u32, u32)| Unit { cluster: parts[*part as usize].1, kind: UnitKind::Part(*part) };
        let mut units: Vec<Unit> = map_all(&order, unit);
        let mut keys: Vec<u32> = order.iter().map(|(key, _)| *key).collect();
        while units.len() > PIECE {
            let mut left = Vec::with_capacity(units.len() / 32);
            for piece in pieces_of(&units, &keys) {
                top.append(piece, &mut left);
            }
            units = left;
            keys = map_all(&units, |unit| space.key(unit.cluster.mean));
        }
        let mut root = PieceTree::default();
        let split = SplitPiece::new(units.iter().map(|unit| &unit.cluster), units.len() / 3);
        let in_order: Vec<Unit> = split.order.iter().map(|unit| units[*unit]).collect();
        root.add_part(&in_order, &split.parts, split.parts[0]);
        top.append(root, &mut Vec::new());
        top
    }

    /// Stores the masks below all nodes. `mask_of` returns the mask of the instance in a slot.
    /// O(nodes).
    pub fn set_masks(&mut self, mask_of: impl Fn(u32) -> u32) {
        self.masks = vec![NodeMasks::default(); self.nodes.len()];
        // Children come before their parents, and the root is the parent of the last ones.
        for node in (1..self.nodes.len()).chain([0]) {
            let record = &self.nodes[node];
            let children = std::array::from_fn(|slot| match record.child(slot) {
                Some(ChildRef::Leaf(leaf)) => MaskShares::of_part(self.part(leaf).map_or(0, |part| mask_of(part.slot))),
                Some(ChildRef::Node(child)) => self.masks[child as usize].shares,
                None => MaskShares::default(),
            });
            self.masks[node] = NodeMasks::new(&children, &record.flux);
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
        Self {
            id: NEXT_ID.fetch_add(1, Relaxed),
            nodes: vec![Node::EMPTY],
            places,
            parts,
            first_parts,
            masks: Vec::new(),
        }
    }

    /// The part that a leaf is. `leaf` are its child bits below [`LEAF`]. `None` if there
    /// is no such part.
    pub fn part(&self, leaf: u32) -> Option<Part> {
        if leaf & PART == 0 {
            return Some(Part { slot: leaf, entry: ChildRef::Node(0) });
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

    /// Appends the nodes of a piece, and its units to `left`. The last node of a piece without units
    /// is the root.
    fn append(&mut self, piece: PieceTree, left: &mut Vec<Unit>) {
        let first = self.nodes.len() as u32;
        let root = if piece.left.is_empty() { piece.nodes.len() - 1 } else { usize::MAX };
        for (number, PieceNode { node, children }) in piece.nodes.into_iter().enumerate() {
            let index = if number == root { 0 } else { self.nodes.len() as u32 };
            if number == root {
                self.nodes[0] = node;
            } else {
                self.nodes.push(node);
            }
            for (slot, child) in children.into_iter().enumerate() {
                let place = index * WIDTH as u32 + slot as u32;
                self.nodes[index as usize].children[slot] = match child.map(|child| child.above(first)) {
                    None => EMPTY_SLOT,
                    Some(UnitKind::Part(part)) => {
                        self.places[part as usize] = place;
                        self.parts[part as usize].leaf(part)
                    }
                    Some(UnitKind::Node(node) | UnitKind::InPiece(node)) => {
                        self.nodes[node as usize].parent = place;
                        node
                    }
                };
            }
        }
        left.extend(piece.left.into_iter().map(|unit| Unit { kind: unit.kind.above(first), ..unit }));
    }
}

/// The nodes of a piece, each after its children, and the units that it leaves.
#[derive(Default)]
struct PieceTree {
    nodes: Vec<PieceNode>,
    left: Vec<Unit>,
}

/// A node whose children are not named yet, and these children.
struct PieceNode {
    node: Node,
    children: [Option<UnitKind>; WIDTH],
}

impl PieceTree {
    /// Makes the nodes below the costliest parts of a piece, of which it leaves at most `most`.
    fn new(units: &[Unit], most: usize) -> Self {
        let split = SplitPiece::new(units.iter().map(|unit| &unit.cluster), PIECE);
        let in_order: Vec<Unit> = split.order.iter().map(|unit| units[*unit]).collect();
        let mut tree = Self::default();
        for part in split.costliest_parts(most) {
            let unit =
                if part.count == 1 { in_order[part.first] } else { tree.add_part(&in_order, &split.parts, part) };
            tree.left.push(unit);
        }
        tree
    }

    /// Makes the node of one of `parts` and the nodes below it. `units` are in the order of the
    /// parts.
    fn add_part(&mut self, units: &[Unit], parts: &[PiecePart], part: PiecePart) -> Unit {
        let whole = PiecePart { is_tiny: false, ..part };
        let children = Children::choose(whole, |_, part| Some(part.halves?.map(|half| parts[half])));
        let mut below = Vec::with_capacity(WIDTH);
        for (child, is_inlined) in children.iter() {
            if is_inlined || child.count <= 1 {
                below.extend_from_slice(&units[child.first..child.first + child.count]);
            } else {
                below.push(self.add_part(units, parts, *child));
            }
        }
        self.add_node(&below)
    }

    /// Makes a node of at most [`WIDTH`] units.
    fn add_node(&mut self, units: &[Unit]) -> Unit {
        let mut wide = WideCluster::EMPTY;
        let mut children = [None; WIDTH];
        for (slot, unit) in units.iter().enumerate() {
            wide.set(slot, &unit.cluster);
            children[slot] = Some(unit.kind);
        }
        let cluster = wide.merged().cluster;
        let mut node = Node::EMPTY;
        node.pack(&wide, &cluster.aabb, WIDTH);
        self.nodes.push(PieceNode { node, children });
        Unit { cluster, kind: UnitKind::InPiece(self.nodes.len() as u32 - 1) }
    }
}

/// The trees of all pieces, in their order in space. `keys` are the units' places in it.
fn pieces_of(units: &[Unit], keys: &[u32]) -> Vec<PieceTree> {
    let pieces = units.len().div_ceil(SHARE);
    let ranges: Vec<[usize; 2]> =
        (0..pieces).map(|piece| [piece, piece + 1].map(|piece| piece_start(keys, pieces, piece))).collect();
    map_all(&ranges, |[start, end]| PieceTree::new(&units[*start..*end], units_left(pieces)))
}

/// The results of a function for all items, in their order. On all threads with the feature `parallel`.
fn map_all<T: Sync, R: Send>(items: &[T], result: impl Fn(&T) -> R + Sync + Send) -> Vec<R> {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        items.par_iter().map(result).collect()
    }
    #[cfg(not(feature = "parallel"))]
    items.iter().map(result).collect()
}

/// Sorts pairs of which no two are equal, so the result does not depend on the threads.
fn sort(pairs: &mut [(u32, u32)]) {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        pairs.par_sort_unstable();
    }
    #[cfg(not(feature = "parallel"))]
    pairs.sort_unstable();
}

#[cfg(test)]
mod tests;

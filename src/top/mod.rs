//! The top level: one tree over the parts of all instances, built anew after every change.
//!
//! A partition of space lasts (`partition.rs`), and gives the tree its nodes. Each build sorts the parts into the cells
//! of the partition by their mean positions. The parts of a cell are the leaves below its node. If there are more than
//! a node holds, they lie below further nodes, *runs*, which do not last. Nodes are packed upward from there.
//!
//! Twin of the stages in `plan/top.rs`, which build the same tree on the GPU; a test there compares both.

pub(crate) mod masks;
pub(crate) mod partition;
pub(crate) mod stages;

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crate::cluster::Cluster;
use crate::instance::part::{PART, PART_BITS, Part};
use crate::math::dice::hash;
use crate::math::parallel::map_all;
use crate::tree::{ChildRef, EMPTY_SLOT, LEAF, NO_PARENT, Node, WIDTH, WideCluster};
use masks::{MaskShares, NodeMasks};
use partition::{PartId, Partition, ROOT};

/// There is room for one run for this many parts, of whatever cell. Cells of 9 parts or more need no more.
pub(crate) const PARTS_PER_RUN: usize = 4;

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
    /// The first run.
    first_run: u32,
}

/// A part or a node that has no parent yet.
#[derive(Clone, Copy)]
struct Unit {
    cluster: Cluster,
    kind: UnitKind,
}

#[derive(Clone, Copy)]
enum UnitKind {
    /// A node without parts, or a slot without a node.
    Empty,
    /// The number of a part.
    Part(u32),
    /// The index of a node.
    Node(u32),
}

impl Unit {
    const EMPTY: Self = Self { cluster: Cluster::EMPTY, kind: UnitKind::Empty };
}

impl Default for TopLevel {
    /// Without instances.
    fn default() -> Self {
        Self::without_nodes(&[], 0)
    }
}

impl TopLevel {
    /// Builds a tree over parts and their clusters, in the order of the slots of their instances,
    /// of which there are `slots`. O(n log n).
    pub fn build(parts: &[(Part, Cluster)], slots: usize, partition: &Partition) -> Self {
        let top = Self::without_nodes(parts, slots);
        let cell = |index: &u32| {
            let (Part { slot, .. }, Cluster { flux, mean, .. }) = &parts[*index as usize];
            let id = PartId { slot: *slot, index: index - top.first_parts[*slot as usize] };
            (*flux > 0.0).then(|| (partition.cell(*mean, id.identity()), *index))
        };
        let all: Vec<u32> = (0..parts.len() as u32).collect();
        let mut order: Vec<(u32, u32)> = map_all(&all, cell).into_iter().flatten().collect();
        sort(&mut order);
        let mut starts = vec![0; partition.len() + 1];
        order.iter().for_each(|(cell, _)| starts[*cell as usize + 1] += 1);
        (0..partition.len()).for_each(|cell| starts[cell + 1] += starts[cell]);
        let mut build = Build { top, parts, order, starts, partition };
        build.top.first_run = partition.len() as u32;
        build.top.nodes.resize(partition.len() + build.order.len() / PARTS_PER_RUN, Node::EMPTY);
        build.unit(ROOT);
        build.top
    }

    /// Stores the masks below all nodes. `mask_of` returns the mask of the instance in a slot.
    /// O(nodes).
    pub fn set_masks(&mut self, mask_of: impl Fn(u32) -> u32) {
        self.masks = vec![NodeMasks::default(); self.nodes.len()];
        self.set_masks_below(ROOT, &mask_of);
    }

    fn set_masks_below(&mut self, node: u32, mask_of: &impl Fn(u32) -> u32) -> MaskShares {
        let children = std::array::from_fn(|slot| match self.nodes[node as usize].child(slot) {
            Some(ChildRef::Leaf(leaf)) => MaskShares::of_part(self.part(leaf).map_or(0, |part| mask_of(part.slot))),
            Some(ChildRef::Node(child)) => self.set_masks_below(child, mask_of),
            None => MaskShares::default(),
        });
        self.masks[node as usize] = NodeMasks::new(&children, &self.nodes[node as usize].flux);
        self.masks[node as usize].shares
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
            first_run: u32::MAX,
        }
    }

    /// What changes with the children of a node. A run has the name of its children.
    pub fn name(&self, node: u32) -> u32 {
        let named = |slot: usize| match self.nodes[node as usize].child(slot) {
            None => 0,
            Some(ChildRef::Node(child)) if child >= self.first_run => self.name(child),
            Some(ChildRef::Node(child)) => child,
            Some(ChildRef::Leaf(leaf)) => {
                self.part(leaf).map_or(0, |part| hash(part.slot) ^ entry_bits(part.entry) ^ LEAF)
            }
        };
        (0..WIDTH).fold(0, |sum: u32, slot| sum.wrapping_add(hash(named(slot) ^ hash(slot as u32))))
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
}

fn entry_bits(entry: ChildRef) -> u32 {
    match entry {
        ChildRef::Node(node) => node,
        ChildRef::Leaf(light) => LEAF | light,
    }
}

/// A build, and what it reads.
struct Build<'a> {
    top: TopLevel,
    parts: &'a [(Part, Cluster)],
    /// The cells and the numbers of the parts that shine, in this order.
    order: Vec<(u32, u32)>,
    /// For each cell the place of its first part in that order, and the number of all these parts.
    starts: Vec<u32>,
    partition: &'a Partition,
}

impl Build<'_> {
    /// Makes a node of the partition and those below it.
    fn unit(&mut self, node: u32) -> Unit {
        let Some(divided) = self.partition.divided(node) else { return self.cell(node) };
        let mut units = [Unit::EMPTY; WIDTH];
        for (unit, child) in units.iter_mut().zip(divided.children()) {
            *unit = self.unit(*child);
        }
        self.pack(node, &units)
    }

    /// Makes the node of a cell, and runs if it has more parts than a node holds. A single part needs no node.
    fn cell(&mut self, cell: u32) -> Unit {
        let [start, end] = [cell, cell + 1].map(|cell| self.starts[cell as usize] as usize);
        let unit = |(_, part): &(u32, u32)| Unit { cluster: self.parts[*part as usize].1, kind: UnitKind::Part(*part) };
        let mut units: Vec<Unit> = self.order[start..end].iter().map(unit).collect();
        if units.len() == 1 && cell != ROOT {
            return units[0];
        }
        let mut next = self.partition.len() + start / PARTS_PER_RUN;
        while units.len() > WIDTH {
            let mut run = |units: &[Unit]| {
                next += 1;
                self.pack(next as u32 - 1, units)
            };
            units = units.chunks(WIDTH).map(&mut run).collect();
        }
        self.pack(cell, &units)
    }

    /// Makes a node of at most [`WIDTH`] units.
    fn pack(&mut self, index: u32, units: &[Unit]) -> Unit {
        let mut wide = WideCluster::EMPTY;
        let mut node = Node::EMPTY;
        for (slot, unit) in units.iter().enumerate() {
            wide.set(slot, &unit.cluster);
            let place = index * WIDTH as u32 + slot as u32;
            node.children[slot] = match unit.kind {
                UnitKind::Empty => EMPTY_SLOT,
                UnitKind::Part(part) => {
                    self.top.places[part as usize] = place;
                    self.top.parts[part as usize].leaf(part)
                }
                UnitKind::Node(child) => {
                    self.top.nodes[child as usize].parent = place;
                    child
                }
            };
        }
        let cluster = wide.merged().cluster;
        if cluster.flux <= 0.0 && index != ROOT {
            return Unit::EMPTY;
        }
        node.pack(&wide, &cluster.aabb, WIDTH);
        self.top.nodes[index as usize] = node;
        Unit { cluster, kind: UnitKind::Node(index) }
    }
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

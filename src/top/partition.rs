//! A partition of space among the nodes of the top level. It lasts, while what lies in it moves.
//!
//! A node of the partition is a *cell*, or planes divide it among up to eight nodes below it. Its number is that of
//! its node in the top level for as long as it exists. Every part lies in one cell, by its mean position; the parts of
//! a cell become the leaves below its node. The partition is divided anew only where that is worth it: see
//! [`Partition::renew`].

mod apart;
mod divided;
mod division;
mod part_id;
pub(crate) mod renewal;

#[cfg(feature = "gpu-plan")]
use std::collections::BinaryHeap;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

pub(crate) use divided::Divided;
use divided::NO_CHILD;
use division::Division;
pub(crate) use part_id::PartId;

use glam::{DVec3, Vec3};

use super::stages::Stage;
use crate::instance::sector;
use crate::tree::{NO_PARENT, WIDTH};

/// A cell with more parts is divided.
pub(crate) const MOST_PARTS: u32 = 16;

/// A divided node of more parts is divided anew over several renewals, and not at all for a part far away, which is set
/// apart instead.
pub(crate) const MOST_AT_ONCE: u32 = 4096;

/// The next [`Partition::id`].
static NEXT_ID: AtomicU64 = AtomicU64::new(1);

/// The number of the root.
pub(crate) const ROOT: u32 = 0;

/// [`Filed::cell`] of a part that does not shine.
const NOWHERE: u32 = u32::MAX;

/// Where a part is filed.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Filed {
    /// [`NOWHERE`] if it does not shine.
    cell: u32,
    /// Its place in the list of the cell.
    place: u32,
}

#[derive(Clone, Debug)]
enum Content {
    Free,
    Cell(Vec<PartId>),
    Divided(Box<Divided>),
}

#[derive(Clone, Debug)]
struct PoolNode {
    /// Its place (`node * WIDTH + slot`) below its parent, or [`NO_PARENT`].
    parent: u32,
    /// The parts below it.
    count: u32,
    content: Content,
    /// The number of the last change of its planes, children, parent or stage.
    changed: u64,
    is_due: bool,
    /// A part was filed that is far from all that the node was divided for.
    has_far_parts: bool,
}

/// See the module.
#[derive(Clone, Debug)]
pub(crate) struct Partition {
    /// Tells partitions apart whose changes have the same numbers.
    #[cfg_attr(not(feature = "gpu-plan"), expect(dead_code, reason = "only plans read it"))]
    id: u64,
    /// The root first.
    nodes: Vec<PoolNode>,
    /// The numbers of nodes that are not in use.
    free: Vec<u32>,
    /// The parts of each instance slot.
    filed: Vec<Vec<Filed>>,
    /// Nodes that may have to be divided anew.
    due: Vec<u32>,
    /// New planes for a large node that are not in use yet.
    division: Option<Division>,
    /// What positions are relative to.
    origin: DVec3,
    /// Where the origin is not on a grid, what the planes are measured from.
    base: Option<DVec3>,
    /// The sector of the origin.
    home: [i32; 3],
    /// The number of the last change of any node.
    number: u64,
}

impl Default for Partition {
    fn default() -> Self {
        let root = PoolNode {
            parent: NO_PARENT,
            count: 0,
            content: Content::Cell(Vec::new()),
            changed: 1,
            is_due: false,
            has_far_parts: false,
        };
        Self {
            id: NEXT_ID.fetch_add(1, Relaxed),
            nodes: vec![root],
            free: Vec::new(),
            filed: Vec::new(),
            due: Vec::new(),
            division: None,
            origin: DVec3::ZERO,
            base: Some(DVec3::ZERO),
            home: [0; 3],
            number: 1,
        }
    }
}

impl Partition {
    /// The number of nodes, free ones among them included.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// The number of the last change of any node, at least 1.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Tells partitions apart whose changes have the same numbers.
    #[cfg(feature = "gpu-plan")]
    pub fn id(&self) -> u64 {
        self.id
    }

    /// Another partition that is like this one now.
    pub fn fork(&self) -> Self {
        Self { id: NEXT_ID.fetch_add(1, Relaxed), ..self.clone() }
    }

    /// How a node divides space; `None` for a cell.
    pub fn divided(&self, node: u32) -> Option<&Divided> {
        match &self.nodes[node as usize].content {
            Content::Divided(divided) => Some(divided),
            _ => None,
        }
    }

    /// The place of a node below its parent, or [`NO_PARENT`].
    #[cfg(feature = "gpu-plan")]
    pub fn parent(&self, node: u32) -> u32 {
        self.nodes[node as usize].parent
    }

    /// All divided nodes: their numbers, the places below their parents, the numbers of their last changes, and how
    /// they divide space.
    #[cfg(feature = "gpu-plan")]
    pub fn all_divided(&self) -> impl Iterator<Item = (u32, u32, u64, &Divided)> {
        (0..).zip(&self.nodes).filter_map(|(index, node)| match &node.content {
            Content::Divided(divided) => Some((index, node.parent, node.changed, &**divided)),
            _ => None,
        })
    }

    /// The cell in which a position lies. O(depth).
    pub fn cell(&self, position: Vec3, identity: u32) -> u32 {
        let mut node = ROOT;
        while let Content::Divided(divided) = &self.nodes[node as usize].content {
            node = divided.child(position.to_array(), self.home, identity);
        }
        node
    }

    /// Files the parts of an instance slot: their mean positions, `None` for those that do not shine. O(parts).
    pub fn file(&mut self, slot: u32, means: impl Iterator<Item = Option<Vec3>>) {
        if self.filed.len() <= slot as usize {
            self.filed.resize(slot as usize + 1, Vec::new());
        }
        let count = self.file_from(slot, 0, means);
        for index in (count..self.filed[slot as usize].len()).rev() {
            self.put(PartId { slot, index: index as u32 }, NOWHERE);
        }
        self.filed[slot as usize].truncate(count);
    }

    /// Files the parts of a slot that has been filed, from `first` on. Returns the number of the next part.
    pub fn file_from(&mut self, slot: u32, first: u32, means: impl Iterator<Item = Option<Vec3>>) -> usize {
        let mut index = first;
        for mean in means {
            let part = PartId { slot, index };
            let cell = mean.map_or(NOWHERE, |mean| self.cell_of(mean, part.identity()));
            self.put(part, cell);
            index += 1;
        }
        index as usize
    }

    /// The number of parts of a slot that were filed.
    pub fn filed(&self, slot: u32) -> usize {
        self.filed.get(slot as usize).map_or(0, Vec::len)
    }

    /// As [`Partition::cell`]. A position that is far from all parts of a node is set apart from them, or the node is to be
    /// divided anew if it has few.
    fn cell_of(&mut self, position: Vec3, identity: u32) -> u32 {
        let exact = self.origin + position.as_dvec3();
        // Another origin rounds positions otherwise.
        let rounding = 1.0e-6 * f64::from(position.length());
        let (mut node, mut is_noted) = (ROOT, false);
        while let Content::Divided(divided) = &self.nodes[node as usize].content {
            let child = divided.child(position.to_array(), self.home, identity);
            if !is_noted && divided.is_far(exact, rounding) {
                if self.nodes[node as usize].count > MOST_AT_ONCE {
                    self.set_apart(node, exact);
                    return self.cell(position, identity);
                }
                self.nodes[node as usize].has_far_parts = true;
                self.set_due(node);
                is_noted = true;
            }
            node = child;
        }
        node
    }

    fn set_due(&mut self, node: u32) {
        if !std::mem::replace(&mut self.nodes[node as usize].is_due, true) {
            self.due.push(node);
        }
    }

    /// Moves a part to a cell.
    fn put(&mut self, part: PartId, cell: u32) {
        let parts = &mut self.filed[part.slot as usize];
        if parts.len() <= part.index as usize {
            parts.resize(part.index as usize + 1, Filed { cell: NOWHERE, place: 0 });
        }
        let former = parts[part.index as usize];
        if former.cell == cell {
            return;
        }
        if former.cell != NOWHERE {
            let Content::Cell(parts) = &mut self.nodes[former.cell as usize].content else { return };
            parts.swap_remove(former.place as usize);
            if let Some(moved) = parts.get(former.place as usize) {
                self.filed[moved.slot as usize][moved.index as usize].place = former.place;
            }
            self.count(former.cell, false);
            self.filed[part.slot as usize][part.index as usize].cell = NOWHERE;
        }
        if cell != NOWHERE {
            self.add(part, cell);
            self.count(cell, true);
        }
    }

    /// Adds a part to the list of a cell.
    fn add(&mut self, part: PartId, cell: u32) {
        if let Content::Cell(parts) = &mut self.nodes[cell as usize].content {
            self.filed[part.slot as usize][part.index as usize] = Filed { cell, place: parts.len() as u32 };
            parts.push(part);
        }
    }

    /// Counts a part that was added to a cell or removed from it, up to the root.
    fn count(&mut self, cell: u32, is_added: bool) {
        let mut node = cell;
        loop {
            let count = &mut self.nodes[node as usize].count;
            *count = if is_added { *count + 1 } else { *count - 1 };
            if self.should_renew(node) {
                self.set_due(node);
            }
            match self.nodes[node as usize].parent {
                NO_PARENT => break,
                parent => node = parent / WIDTH as u32,
            }
        }
    }

    /// A partition of at most `most` nodes that divides space by the planes of this one's largest nodes.
    #[cfg(feature = "gpu-plan")]
    pub fn coarse(&self, most: usize) -> Self {
        let mut coarse = Self { id: NEXT_ID.fetch_add(1, Relaxed), ..Self::default() };
        let mut largest = BinaryHeap::from([(self.nodes[ROOT as usize].count, ROOT, ROOT)]);
        while let Some((_, node, copy)) = largest.pop() {
            let Some(divided) = self.divided(node) else { continue };
            if coarse.nodes.len() + divided.children().len() > most {
                break;
            }
            let mut divided = Box::new(*divided);
            for slot in 0..divided.children().len() {
                let child = divided.children[slot];
                divided.children[slot] = coarse.new_node(copy * WIDTH as u32 + slot as u32);
                coarse.nodes[divided.children[slot] as usize].content = Content::Cell(Vec::new());
                largest.push((self.nodes[child as usize].count, child, divided.children[slot]));
            }
            coarse.nodes[copy as usize].content = Content::Divided(divided);
            coarse.nodes[copy as usize].changed = 1;
        }
        // Children come after their parents.
        for node in (0..coarse.nodes.len() as u32).rev() {
            coarse.set_stage(node);
        }
        Self { origin: self.origin, base: self.base, home: self.home, ..coarse }
    }

    /// Sets what positions are relative to. O(nodes) where the origin is not on a grid, and O(1) otherwise.
    pub fn set_origin(&mut self, origin: DVec3, is_on_grid: bool) {
        let base = (!is_on_grid).then_some(origin);
        self.origin = origin;
        self.home = if is_on_grid { sector::number(origin.as_vec3()) } else { [0; 3] };
        if self.base == base {
            return;
        }
        self.base = base;
        self.number += 1;
        for node in &mut self.nodes {
            if let Content::Divided(divided) = &mut node.content {
                node.changed = self.number;
                divided.measure(base);
            }
        }
    }

    /// A node and all above it.
    fn path(&self, node: u32) -> impl Iterator<Item = u32> {
        let above = |node: &u32| match self.nodes[*node as usize].parent {
            NO_PARENT => None,
            parent => Some(parent / WIDTH as u32),
        };
        std::iter::successors(Some(node), above)
    }

    /// Frees all nodes below a node.
    fn free_below(&mut self, node: u32) {
        if let Content::Divided(divided) = std::mem::replace(&mut self.nodes[node as usize].content, Content::Free) {
            for child in divided.children() {
                if self.division.as_ref().is_some_and(|division| division.node == *child) {
                    self.division = None;
                }
                self.free_below(*child);
                self.free.push(*child);
            }
        }
    }

    fn new_node(&mut self, parent: u32) -> u32 {
        let node =
            PoolNode { parent, count: 0, content: Content::Free, changed: 0, is_due: false, has_far_parts: false };
        if let Some(free) = self.free.pop() {
            self.nodes[free as usize] = node;
            return free;
        }
        self.nodes.push(node);
        self.nodes.len() as u32 - 1
    }

    /// Finds the stages of all nodes above a node, as far as they change.
    fn set_stages_above(&mut self, node: u32) {
        let path: Vec<u32> = self.path(node).skip(1).collect();
        for above in path {
            if !self.set_stage(above) {
                break;
            }
        }
    }

    /// Finds the stage of a divided node. Returns whether it is another one.
    fn set_stage(&mut self, node: u32) -> bool {
        let Some(divided) = self.divided(node) else { return false };
        let below =
            divided.children.map(|child| (child != NO_CHILD).then(|| Some(self.divided(child)?.stage)).flatten());
        let stage = Stage::above(below);
        let number = self.number;
        let node = &mut self.nodes[node as usize];
        let Content::Divided(divided) = &mut node.content else { return false };
        if divided.stage == stage {
            return false;
        }
        divided.stage = stage;
        node.changed = number;
        true
    }
}

#[cfg(test)]
impl Partition {
    /// Whether new planes are under way.
    pub fn is_dividing(&self) -> bool {
        self.division.is_some()
    }

    /// Checks that parents, children, counts, lists and stages agree, and that what should be divided anew is due.
    pub fn check(&self) {
        let mut counts = vec![0; self.len()];
        for (slot, parts) in self.filed.iter().enumerate() {
            for (index, Filed { cell, place }) in parts.iter().enumerate().filter(|(_, filed)| filed.cell != NOWHERE) {
                let Content::Cell(list) = &self.nodes[*cell as usize].content else { panic!("{cell} is no cell") };
                assert_eq!(list[*place as usize], PartId { slot: slot as u32, index: index as u32 });
                self.path(*cell).for_each(|node| counts[node as usize] += 1);
            }
        }
        let mut free = self.len();
        let mut stack = vec![(ROOT, NO_PARENT)];
        while let Some((index, parent)) = stack.pop() {
            free -= 1;
            let node = &self.nodes[index as usize];
            assert_eq!((node.parent, node.count), (parent, counts[index as usize]), "node {index}");
            assert!(node.is_due || !self.should_renew(index), "node {index}");
            match &node.content {
                Content::Free => panic!("node {index} is free"),
                Content::Cell(list) => assert_eq!(list.len(), node.count as usize),
                Content::Divided(divided) => {
                    let stage = |child| (child != NO_CHILD).then(|| Some(self.divided(child)?.stage)).flatten();
                    assert_eq!(divided.stage, Stage::above(divided.children.map(stage)), "node {index}");
                    let place = |slot| index * WIDTH as u32 + slot;
                    stack.extend(divided.children().iter().zip(0..).map(|(child, slot)| (*child, place(slot))));
                }
            }
        }
        assert_eq!(free, self.free.len());
    }
}

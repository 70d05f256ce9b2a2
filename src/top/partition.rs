//! A partition of space among the nodes of the top level. It lasts, while what lies in it moves.
//!
//! A node of the partition is a *cell*, or planes divide it among up to eight nodes below it. Its number is that of
//! its node in the top level for as long as it exists. Every part lies in one cell, by its mean position; the parts of
//! a cell become the leaves below its node. The partition is divided anew only where that is worth it: see
//! [`Partition::renew`].

mod apart;
mod bounds;
mod divided;
mod division;
mod part_id;
pub(crate) mod renewal;
mod within;

#[cfg(feature = "gpu-plan")]
use std::collections::BinaryHeap;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

pub(crate) use bounds::{Bounds, Place};
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
    /// The number of its lights.
    lights: u32,
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
    /// The lights of these parts.
    lights: u64,
    /// Contains the boxes of these parts, and perhaps of some that were below it.
    reach: Bounds,
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
    /// The lights of all parts of each instance slot.
    lights: Vec<u64>,
    /// Nodes that may have to be divided anew.
    due: Vec<u32>,
    /// New planes for a large node that are not in use yet.
    division: Option<Division>,
    /// What positions are relative to.
    origin: DVec3,
    /// The sector of the origin.
    home: [i32; 3],
    /// The number of the last change of any node.
    number: u64,
}

impl Default for Partition {
    fn default() -> Self {
        let root = PoolNode { content: Content::Cell(Vec::new()), changed: 1, ..PoolNode::below(NO_PARENT) };
        Self {
            id: NEXT_ID.fetch_add(1, Relaxed),
            nodes: vec![root],
            free: Vec::new(),
            filed: Vec::new(),
            lights: Vec::new(),
            due: Vec::new(),
            division: None,
            origin: DVec3::ZERO,
            home: [0; 3],
            number: 1,
        }
    }
}

impl PoolNode {
    /// A node without parts below a place.
    fn below(parent: u32) -> Self {
        Self {
            parent,
            count: 0,
            lights: 0,
            reach: Bounds::EMPTY,
            content: Content::Free,
            changed: 0,
            is_due: false,
            has_far_parts: false,
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

    /// Files the parts of an instance slot: where they are, `None` for those that do not shine. O(parts).
    pub fn file(&mut self, slot: u32, places: impl Iterator<Item = Option<Place>>) {
        if self.filed.len() <= slot as usize {
            self.filed.resize(slot as usize + 1, Vec::new());
            self.lights.resize(slot as usize + 1, 0);
        }
        let count = self.file_from(slot, 0, places);
        for index in (count..self.filed[slot as usize].len()).rev() {
            self.put(PartId { slot, index: index as u32 }, None);
        }
        self.filed[slot as usize].truncate(count);
    }

    /// Files the parts of a slot that has been filed, from `first` on. Returns the number of the next part.
    pub fn file_from(&mut self, slot: u32, first: u32, places: impl Iterator<Item = Option<Place>>) -> usize {
        let mut index = first;
        for place in places {
            self.put(PartId { slot, index }, place);
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
            let is_large = self.nodes[node as usize].count > MOST_AT_ONCE;
            if !is_noted && divided.is_far(exact, rounding, is_large) {
                if is_large {
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

    /// Moves a part to the cell of a place, or out of all.
    fn put(&mut self, part: PartId, place: Option<Place>) {
        let (cell, lights) = match &place {
            None => (NOWHERE, 0),
            Some(place) => (self.cell_of(place.mean, part.identity()), place.lights),
        };
        let parts = &mut self.filed[part.slot as usize];
        if parts.len() <= part.index as usize {
            parts.resize(part.index as usize + 1, Filed { cell: NOWHERE, place: 0, lights: 0 });
        }
        let former = parts[part.index as usize];
        if (former.cell, former.lights) != (cell, lights) {
            if former.cell != NOWHERE {
                let Content::Cell(parts) = &mut self.nodes[former.cell as usize].content else { return };
                parts.swap_remove(former.place as usize);
                if let Some(moved) = parts.get(former.place as usize) {
                    self.filed[moved.slot as usize][moved.index as usize].place = former.place;
                }
                self.count(former.cell, former.lights, false);
                self.lights[part.slot as usize] -= u64::from(former.lights);
                self.filed[part.slot as usize][part.index as usize].cell = NOWHERE;
            }
            if cell != NOWHERE {
                self.add(part, cell, lights);
                self.count(cell, lights, true);
                self.lights[part.slot as usize] += u64::from(lights);
            }
        }
        if let Some(place) = place {
            self.reach_out(Some(cell), &Bounds::around(&place.aabb, self.origin));
        }
    }

    /// Lets the box of a node and of all nodes above it contain a box.
    fn reach_out(&mut self, mut node: Option<u32>, bounds: &Bounds) {
        while let Some(index) = node.filter(|node| self.nodes[*node as usize].reach.grow(bounds)) {
            node = self.above(index);
        }
    }

    /// Adds a part to the list of a cell.
    fn add(&mut self, part: PartId, cell: u32, lights: u32) {
        if let Content::Cell(parts) = &mut self.nodes[cell as usize].content {
            self.filed[part.slot as usize][part.index as usize] = Filed { cell, place: parts.len() as u32, lights };
            parts.push(part);
        }
    }

    /// Counts a part that was added to a cell or removed from it, up to the root.
    fn count(&mut self, cell: u32, lights: u32, is_added: bool) {
        let mut path = Some(cell);
        while let Some(index) = path {
            let node = &mut self.nodes[index as usize];
            let lights = u64::from(lights);
            (node.count, node.lights) = match is_added {
                true => (node.count + 1, node.lights + lights),
                false => (node.count - 1, node.lights - lights),
            };
            if node.count == 0 {
                node.reach = Bounds::EMPTY;
            }
            if self.should_renew(index) {
                self.set_due(index);
            }
            path = self.above(index);
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
        Self { origin: self.origin, home: self.home, ..coarse }
    }

    /// Sets what positions are relative to: the centre of a sector.
    pub fn set_origin(&mut self, origin: DVec3) {
        self.origin = origin;
        self.home = sector::number(origin.as_vec3());
    }

    /// A node and all above it.
    fn path(&self, node: u32) -> impl Iterator<Item = u32> {
        std::iter::successors(Some(node), |node| self.above(*node))
    }

    /// The node above a node.
    fn above(&self, node: u32) -> Option<u32> {
        match self.nodes[node as usize].parent {
            NO_PARENT => None,
            parent => Some(parent / WIDTH as u32),
        }
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
        let node = PoolNode::below(parent);
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
    /// Whether new planes are under way or due.
    pub fn is_dividing(&self) -> bool {
        self.division.is_some() || !self.due.is_empty()
    }

    /// Checks that parents, children, counts, lists and stages agree, and that what should be divided anew is due.
    pub fn check(&self) {
        let mut counts = vec![(0, 0); self.len()];
        for (slot, parts) in self.filed.iter().enumerate() {
            let lights = parts.iter().filter(|filed| filed.cell != NOWHERE).map(|filed| u64::from(filed.lights));
            assert_eq!(lights.sum::<u64>(), self.lights[slot], "slot {slot}");
            for (index, Filed { cell, place, lights }) in
                parts.iter().enumerate().filter(|(_, filed)| filed.cell != NOWHERE)
            {
                let Content::Cell(list) = &self.nodes[*cell as usize].content else { panic!("{cell} is no cell") };
                assert_eq!(list[*place as usize], PartId { slot: slot as u32, index: index as u32 });
                for node in self.path(*cell) {
                    let (count, of_node) = &mut counts[node as usize];
                    (*count, *of_node) = (*count + 1, *of_node + u64::from(*lights));
                }
            }
        }
        let mut free = self.len();
        let mut stack = vec![(ROOT, NO_PARENT)];
        while let Some((index, parent)) = stack.pop() {
            free -= 1;
            let node = &self.nodes[index as usize];
            assert_eq!((node.parent, (node.count, node.lights)), (parent, counts[index as usize]), "node {index}");
            if parent != NO_PARENT && node.count > 0 {
                assert!(self.nodes[parent as usize / WIDTH].reach.contains(&node.reach), "node {index}");
            }
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

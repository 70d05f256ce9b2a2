//! Divides nodes of the partition anew where that is worth it.

use glam::Vec3;

use super::division::{Division, NewNode};
use super::part_id::PartId;
use super::{Bounds, Content, MOST_AT_ONCE, MOST_PARTS, Partition, PoolNode, ROOT};
use crate::cluster::Cluster;
use crate::tree::{BuildItem, WIDTH};

/// A node is divided anew if one of its children has this many times the share of parts that it had, or as many times
/// less.
const SHARE_CHANGE: u32 = 2;

/// A node is divided anew once it has this many times the parts.
const GROWTH: u32 = 2;

/// The child for parts that are set apart was made for one in so many of all.
const APART_SHARE: f32 = 32.0;

/// The parts of nodes that are divided anew in one update; and as many in nodes of more than [`MOST_AT_ONCE`], each
/// counted once for each level.
pub(crate) const RENEWED_PARTS: usize = 16_384;

impl Partition {
    /// Whether a node should be divided anew: a cell with too many parts; a divided node with so few that they fit into
    /// one, one with all parts in one child, one with few parts of which some are far away, and one whose parts are
    /// distributed otherwise than when it was divided.
    pub(super) fn should_renew(&self, node: u32) -> bool {
        let PoolNode { count, content, has_far_parts, .. } = &self.nodes[node as usize];
        let divided = match content {
            Content::Free => return false,
            Content::Cell(_) => return *count > MOST_PARTS,
            Content::Divided(divided) => divided,
        };
        if *count <= WIDTH as u32 || *has_far_parts || self.only_child(node).is_some() {
            return true;
        }
        let built: u32 = divided.built.iter().sum();
        if *count > GROWTH * built {
            return true;
        }
        let scale = *count as f32 / built.max(1) as f32;
        divided.children().iter().zip(divided.built).any(|(child, built)| {
            let (then, now) = (built as f32 * scale, self.nodes[*child as usize].count as f32);
            let (change, few) = (SHARE_CHANGE as f32, WIDTH as f32);
            // A child that was made for parts far away may have a share at once.
            let least = if built == 0 { *count as f32 / APART_SHARE } else { then };
            then > few.max(change * now) || now > few.max(change * least)
        })
    }

    /// Divides nodes anew whose parts have become too many, too few, or distributed otherwise. `cluster` returns the
    /// cluster of a part. Stops once `most` parts were divided, in large nodes and in others, and the next renewal goes
    /// on; a cell is divided whatever its parts. Returns whether a node changed. O(n log n) in `most`.
    pub fn renew(&mut self, mut most: usize, cluster: impl Fn(PartId) -> Cluster) -> bool {
        let (before, mut left) = (self.number, most);
        self.go_on(&mut most, &cluster);
        // The fullest first.
        let Self { due, nodes, .. } = self;
        due.sort_by_key(|node| nodes.get(*node as usize).map_or(0, |node| node.count));
        loop {
            let mut large = Vec::new();
            while left > 0
                && let Some(node) = self.due.pop()
            {
                if node as usize >= self.nodes.len() || !std::mem::take(&mut self.nodes[node as usize].is_due) {
                    continue;
                }
                if !self.should_renew(node) {
                    continue;
                }
                if let Some(child) = self.only_child(node) {
                    self.lift(node, child);
                } else if self.divided(node).is_none() || self.nodes[node as usize].count <= MOST_AT_ONCE {
                    left = left.saturating_sub(self.nodes[node as usize].count as usize);
                    self.division.take_if(|division| division.node == node);
                    let mut division = self.begin_division(node, &cluster);
                    division.go_on(&mut { usize::MAX });
                    self.finish_division(division, &cluster);
                } else {
                    large.push(node);
                }
            }
            // The largest first, since what is below it is divided too.
            large.retain(|node| self.should_renew(*node));
            large.sort_by_key(|node| self.nodes[*node as usize].count);
            if self.division.is_none()
                && let Some(node) = large.last()
            {
                self.division = Some(self.begin_division(*node, &cluster));
                self.go_on(&mut most, &cluster);
            }
            large.iter().for_each(|node| self.set_due(*node));
            // Cells of a finished division may have too many parts by now.
            if left == 0 || large.is_empty() || self.division.is_some() {
                break;
            }
        }
        self.number != before
    }

    /// Forgets how space is divided, so that the next renewal divides it at once. O(parts).
    pub fn restart(&mut self) {
        let mut parts = Vec::with_capacity(self.nodes[ROOT as usize].count as usize);
        self.list_parts(ROOT, &mut parts);
        self.free_below(ROOT);
        (self.number, self.division) = (self.number + 1, None);
        self.nodes.truncate(1);
        self.free.clear();
        let root = &mut self.nodes[ROOT as usize];
        (root.content, root.changed) = (Content::Cell(Vec::with_capacity(parts.len())), self.number);
        for (part, _) in parts {
            let lights = self.filed[part.slot as usize][part.index as usize].lights;
            self.add(part, ROOT, lights);
        }
        self.set_due(ROOT);
    }

    /// Goes on with the division that is under way.
    fn go_on(&mut self, most: &mut usize, cluster: &impl Fn(PartId) -> Cluster) {
        if let Some(mut division) = self.division.take() {
            match division.go_on(most) {
                true => self.finish_division(division, cluster),
                false => self.division = Some(division),
            }
        }
    }

    /// Begins to divide space below a node anew. `cluster` returns the cluster of a part. O(n log n) in its parts.
    fn begin_division(&self, node: u32, cluster: impl Fn(PartId) -> Cluster) -> Division {
        let mut parts = Vec::with_capacity(self.nodes[node as usize].count as usize);
        self.list_parts(node, &mut parts);
        // What is made of them does not depend on the edits before.
        parts.sort_unstable();
        // Directions do not count (docs/decisions.md, 66).
        let item = |((part, _), index): (&(PartId, u32), u32)| {
            BuildItem::new(&Cluster { axis: Vec3::ZERO, ..cluster(*part) }, index)
        };
        let items: Vec<BuildItem> = parts.iter().zip(0..).map(item).collect();
        let root = NewNode { items: 0..items.len(), depth: self.path(node).count(), divided: None };
        Division { node, parts, items, origin: self.origin, nodes: vec![root], rest: vec![0] }
    }

    /// The parts below a node, with their cells.
    fn list_parts(&self, node: u32, parts: &mut Vec<(PartId, u32)>) {
        match &self.nodes[node as usize].content {
            Content::Free => {}
            Content::Cell(of_cell) => parts.extend(of_cell.iter().map(|part| (*part, node))),
            Content::Divided(divided) => divided.children().iter().for_each(|child| self.list_parts(*child, parts)),
        }
    }

    /// Puts a finished division in the place of the node. Parts that were filed anew since it was begun are so again.
    /// `cluster` returns the cluster of a part. O(parts).
    fn finish_division(&mut self, division: Division, cluster: impl Fn(PartId) -> Cluster) {
        let Division { node, parts, items, nodes, origin, .. } = division;
        self.number += 1;
        self.nodes[node as usize].has_far_parts = false;
        self.nodes[node as usize].reach = Bounds::EMPTY;
        let mut below = Vec::with_capacity(parts.len());
        self.list_parts(node, &mut below);
        self.free_below(node);
        if node == ROOT {
            self.nodes.truncate(1);
            self.free.clear();
        }
        let numbers = self.put_nodes(node, &nodes);
        let mut cells = vec![node; parts.len()];
        for (new, number) in nodes.iter().zip(&numbers).filter(|(new, _)| new.divided.is_none()) {
            for item in &items[new.items.clone()] {
                cells[item.index() as usize] = *number;
                self.nodes[*number as usize].reach.grow(&Bounds::around(&item.aabb(), origin));
            }
        }
        below.sort_unstable();
        let mut known = parts.iter().zip(cells).peekable();
        for filed @ (part, _) in below {
            while known.next_if(|((other, _), _)| *other < part).is_some() {}
            // Otherwise it was filed anew since.
            let cell = known.next_if(|(former, _)| **former == filed).map(|(_, cell)| cell);
            let cell = cell.unwrap_or_else(|| {
                let Cluster { mean, aabb, .. } = cluster(part);
                let cell = self.cell(mean, part.identity());
                self.nodes[cell as usize].reach.grow(&Bounds::around(&aabb, self.origin));
                cell
            });
            let lights = self.filed[part.slot as usize][part.index as usize].lights;
            self.add(part, cell, lights);
        }
        // Children come after their parents.
        for (number, new) in numbers.iter().zip(&nodes).rev() {
            self.sum_up(*number);
            self.nodes[*number as usize].changed = self.number;
            if new.divided.is_some() {
                self.set_stage(*number);
            }
            if self.should_renew(*number) {
                self.set_due(*number);
            }
        }
        self.reach_out(self.above(node), &{ self.nodes[node as usize].reach });
        // It may be the only divided child that has parts.
        let parent = self.path(node).nth(1);
        parent.filter(|parent| self.should_renew(*parent)).into_iter().for_each(|parent| self.set_due(parent));
        self.set_stages_above(node);
    }

    /// Puts the nodes of a division in the place of a node. Returns their numbers.
    fn put_nodes(&mut self, node: u32, nodes: &[NewNode]) -> Vec<u32> {
        let mut numbers = vec![node; nodes.len()];
        for (index, new) in nodes.iter().enumerate() {
            let number = numbers[index];
            let Some(divided) = &new.divided else {
                self.nodes[number as usize].content = Content::Cell(Vec::with_capacity(new.items.len()));
                continue;
            };
            let mut divided = divided.clone();
            divided.measure();
            for slot in 0..divided.children().len() {
                let child = self.new_node(number * WIDTH as u32 + slot as u32);
                numbers[divided.children[slot] as usize] = child;
                divided.children[slot] = child;
            }
            self.nodes[number as usize].content = Content::Divided(divided);
        }
        numbers
    }

    /// Counts what is below a node whose children are counted.
    fn sum_up(&mut self, node: u32) {
        let (mut count, mut lights, mut reach) = (0, 0, self.nodes[node as usize].reach);
        match &self.nodes[node as usize].content {
            Content::Free => {}
            Content::Cell(parts) => {
                let lights_of = |part: &PartId| self.filed[part.slot as usize][part.index as usize].lights;
                (count, lights) = (parts.len() as u32, parts.iter().map(|part| u64::from(lights_of(part))).sum());
            }
            Content::Divided(divided) => {
                reach = Bounds::EMPTY;
                for child in divided.children() {
                    let child = &self.nodes[*child as usize];
                    (count, lights) = (count + child.count, lights + child.lights);
                    reach.grow(&child.reach);
                }
            }
        }
        let node = &mut self.nodes[node as usize];
        (node.count, node.lights, node.reach) = (count, lights, reach);
    }
}

//! Divides space anew below a node, a step at a time, while the former planes stay in use.

use std::fmt;
use std::ops::Range;

use glam::DVec3;

use super::divided::Divided;
use super::part_id::PartId;
use crate::cluster::Aabb;
use crate::tree::{BuildItem, WIDTH, divide};

/// Nodes at this depth and below are divided into halves, so that no partition is much deeper.
const MAX_COST_DEPTH: usize = 32;

/// New planes for the parts below a node.
#[derive(Clone)]
pub(super) struct Division {
    /// The node.
    pub node: u32,
    /// The parts below it when the division was begun, and the cells that they were in.
    pub parts: Vec<(PartId, u32)>,
    /// The parts, neighbours where they are below one new node.
    pub items: Vec<BuildItem>,
    /// The origin of their positions.
    pub origin: DVec3,
    /// The first takes the place of the node. Each comes after its parent.
    pub nodes: Vec<NewNode>,
    /// Those that may be divided yet.
    pub rest: Vec<u32>,
}

/// A node that takes the place of others once all are divided.
#[derive(Clone, Debug)]
pub(super) struct NewNode {
    pub items: Range<usize>,
    pub depth: usize,
    /// Its children are numbers of new nodes. `None` for a cell.
    pub divided: Option<Box<Divided>>,
}

impl fmt::Debug for Division {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Division").field("node", &self.node).field("parts", &self.parts.len()).finish_non_exhaustive()
    }
}

impl Division {
    /// Divides nodes until about so many items were divided, and takes the number of these away from `left`.
    /// Returns whether all nodes are divided.
    pub fn go_on(&mut self, left: &mut usize) -> bool {
        while *left > 0
            && let Some(node) = self.rest.pop()
        {
            *left = left.saturating_sub(self.nodes[node as usize].items.len());
            self.divide(node);
        }
        self.rest.is_empty()
    }

    fn divide(&mut self, node: u32) {
        let NewNode { items: range, depth, .. } = self.nodes[node as usize].clone();
        if range.len() <= WIDTH {
            return;
        }
        let items = &mut self.items[range.clone()];
        let parts = &self.parts;
        let identity = |index: u32| parts[index as usize].0.identity();
        let (planes, built) = divide(items, depth >= MAX_COST_DEPTH, identity);
        if planes.count == 0 {
            return;
        }
        let positions = Aabb::around(items.iter().map(BuildItem::position));
        let center = self.origin + positions.center().as_dvec3();
        let mut divided = Box::new(Divided::new(planes, (center, 0.5 * positions.extent().as_dvec3())));
        divided.built = built.map(|count| count as u32);
        for plane in 0..planes.count {
            if let Some(origin) = self.origin.to_array().get(planes.axes[plane] as usize) {
                divided.exact[plane] = f64::from(f32::from_bits(planes.at[plane])) + origin;
            }
        }
        let mut start = range.start;
        for (child, count) in divided.children.iter_mut().zip(built).take(planes.count + 1) {
            *child = self.nodes.len() as u32;
            self.rest.push(*child);
            self.nodes.push(NewNode { items: start..start + count, depth: depth + 1, divided: None });
            start += count;
        }
        self.nodes[node as usize].divided = Some(divided);
    }
}

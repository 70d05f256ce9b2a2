//! Sets a part that is far from all others apart from them, without new planes for the others.

use glam::DVec3;

use super::{Content, Divided, Partition, PoolNode};
use crate::tree::{EXIT, Planes, WIDTH};

impl Partition {
    /// Divides a node by one plane, between all that was in it and a place that is far from it. The node below that
    /// holds the former has the former planes. O(depth).
    pub(super) fn set_apart(&mut self, node: u32, place: DVec3) {
        let Content::Divided(former) = &self.nodes[node as usize].content else { return };
        let gaps = (place - former.center).abs() - former.half;
        let axis = (1..3).fold(0, |widest, axis| if gaps[axis] > gaps[widest] { axis } else { widest });
        let side = (place[axis] - former.center[axis]).signum();
        let mut planes = Planes { count: 1, ..Planes::default() };
        planes.axes[0] = axis as u8;
        planes.ways[0] = [EXIT, EXIT + 1];
        let (min, max) = (former.center - former.half, former.center + former.half);
        let (min, max) = (min.min(place), max.max(place));
        let mut divided = Box::new(Divided::new(planes, (0.5 * (min + max), 0.5 * (max - min))));
        divided.exact[0] = former.center[axis] + side * (former.half[axis] + 0.5 * gaps[axis]);
        divided.measure();
        self.number += 1;
        // The side of the others.
        let slot = if side > 0.0 { 0 } else { 1 };
        let PoolNode { count, lights, reach, .. } = self.nodes[node as usize];
        divided.built[slot] = count;
        for child in 0..2 {
            divided.children[child] = self.new_node(node * WIDTH as u32 + child as u32);
        }
        let [others, apart] = [slot, 1 - slot].map(|slot| divided.children[slot]);
        self.nodes[apart as usize].content = Content::Cell(Vec::new());
        let former = std::mem::replace(&mut self.nodes[node as usize].content, Content::Divided(divided));
        let of_others = &mut self.nodes[others as usize];
        (of_others.count, of_others.lights, of_others.reach) = (count, lights, reach);
        self.move_content(former, (node, others));
        self.set_stage(node);
        self.nodes[node as usize].changed = self.number;
        self.set_stages_above(node);
    }

    /// The child that holds all parts of a node, if it is divided.
    pub(super) fn only_child(&self, node: u32) -> Option<u32> {
        let count = self.nodes[node as usize].count;
        let holds_all = |child: &&u32| self.nodes[**child as usize].count == count && self.divided(**child).is_some();
        self.divided(node)?.children().iter().find(holds_all).copied()
    }

    /// Puts a divided child that holds all parts of a node in the place of the node. O(nodes below its siblings).
    pub(super) fn lift(&mut self, node: u32, child: u32) {
        self.number += 1;
        let content = std::mem::replace(&mut self.nodes[child as usize].content, Content::Free);
        let is_renewed = self.division.as_ref().is_some_and(|division| division.node == child);
        let division = if is_renewed { self.division.take() } else { None };
        self.free_below(node);
        self.division = self.division.take().or(division);
        self.move_content(content, (child, node));
        self.set_stages_above(node);
    }

    /// Gives a node what another one was, and what is under way for it.
    fn move_content(&mut self, content: Content, (from, to): (u32, u32)) {
        if let Content::Divided(divided) = &content {
            for (child, slot) in divided.children().iter().zip(0..) {
                self.nodes[*child as usize].parent = to * WIDTH as u32 + slot;
                self.nodes[*child as usize].changed = self.number;
            }
        }
        self.nodes[to as usize].has_far_parts |= std::mem::take(&mut self.nodes[from as usize].has_far_parts);
        self.nodes[to as usize].content = content;
        self.nodes[to as usize].changed = self.number;
        self.set_due(to);
        if let Some(division) = &mut self.division
            && division.node == from
        {
            division.node = to;
        }
    }
}

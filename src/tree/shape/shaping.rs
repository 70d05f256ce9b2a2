//! Shapes a tree by a work list that can stop after any step and go on later, on any thread.
//!
//! The list holds ranges of lights. The lights of a range are divided among the children of one node,
//! and the ranges of these children join the list. They are independent, so several threads may shape
//! them. The shape has the same bits in all cases.

use super::children::ChildChooser;
use super::group::{BuildItem, Group, SumsOfRuns};
use super::sides::sides;
use super::split::{MIN_STEPPED, Splitting, split_at_once};
use crate::tree::node::{EMPTY_SLOT, LEAF, NO_PARENT, WIDTH};
use crate::tree::units::{NODE_TICKS, whole_split_ticks};

/// Ranges of fewer lights in all are shaped by one thread.
#[cfg(feature = "parallel")]
const PARALLEL_ITEMS: usize = 4096;

/// Nodes at this depth and below are split into halves. So no tree is deeper than this plus the
/// bits of its number of lights. A million lights make 8 or 9 levels; at geometric distances from
/// 1e-9 m to 1e9 m they make 16.
pub(super) const MAX_COST_DEPTH: u32 = 32;

/// One node of a shape. Nodes are stored depth first: a parent before its children, and every
/// subtree contiguous.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ShapeNode {
    /// [`LEAF`] with an item's index, or a node's index.
    /// [`EMPTY_SLOT`] from `count` on.
    pub(crate) children: [u32; WIDTH],
    pub(crate) count: u32,
    /// `node * WIDTH + slot`, or [`NO_PARENT`].
    pub(in crate::tree) parent: u32,
}

/// A shape in the making.
#[derive(Default)]
pub(in crate::tree) struct Shaping {
    /// The nodes so far, depth first.
    pub nodes: Vec<ShapeNode>,
    /// The number of sides, which are the children of the root; 0 for a tree that is not divided.
    pub sides: usize,
    /// The sums over all items.
    whole: SumsOfRuns<Group>,
    /// What is left to shape; the last range comes first.
    ranges: Vec<Range>,
    /// The node whose children are being chosen.
    choice: Option<Choice>,
    /// Their groups.
    chooser: ChildChooser,
    /// The state of splits of many items, once there was one.
    split: Option<Box<Splitting>>,
}

/// Items that become a node with all that is below it.
#[derive(Clone, Copy)]
struct Range {
    group: Group,
    /// The first item.
    first: usize,
    /// The depth of the node.
    depth: u32,
    /// The place of the node: `parent * WIDTH + slot`, or [`NO_PARENT`].
    place: u32,
}

/// The choice of the children of a node.
struct Choice {
    node: usize,
    range: Range,
    /// The place of the group that is being split in steps.
    splitting: Option<usize>,
}

impl Shaping {
    /// Reserves memory for the nodes over `count` items.
    pub fn reserve(&mut self, count: usize) {
        self.nodes.reserve_exact(likely_nodes(count));
    }

    /// Adds up to `most` more of all items to the sums, before the start. Returns their number, 0 once
    /// all have been added.
    pub fn sum(&mut self, items: &[BuildItem], most: usize) -> usize {
        self.whole.add_some(items, most, Group::add_items)
    }

    /// Starts the shape of the tree of an object over all items, of which there is at least one: it is
    /// divided into sides if its lights disagree in direction.
    pub fn start_tree(&mut self, items: &mut [BuildItem]) {
        match sides(items) {
            Some(sides) => {
                self.sides = sides.len();
                self.nodes.push(ShapeNode::EMPTY);
                let root = Range { group: *self.whole.get(), first: 0, depth: 0, place: NO_PARENT };
                root.list_children(0, sides.iter().map(|side| (side, false)), items, &mut self.nodes, &mut self.ranges);
            }
            None => self.start(),
        }
    }

    /// Starts the shape over all items.
    pub fn start(&mut self) {
        self.start_at(0);
    }

    /// [`Shaping::start`] as if the root were at some depth.
    pub(super) fn start_at(&mut self, depth: u32) {
        self.ranges.push(Range { group: *self.whole.get(), first: 0, depth, place: NO_PARENT });
    }

    /// Whether all nodes are complete.
    pub fn is_done(&self) -> bool {
        self.ranges.is_empty() && self.choice.is_none()
    }

    /// Shapes what is left, on several threads if that is much.
    pub fn finish(&mut self, items: &mut [BuildItem]) {
        while !self.is_done() {
            #[cfg(feature = "parallel")]
            if self.choice.is_none()
                && self.ranges.len() > 1
                && self.ranges.iter().map(|range| range.group.count).sum::<usize>() >= PARALLEL_ITEMS
            {
                return self.finish_in_parallel(items);
            }
            self.advance(items, usize::MAX);
        }
    }

    /// Shapes each range by a list of its own.
    #[cfg(feature = "parallel")]
    fn finish_in_parallel(&mut self, items: &mut [BuildItem]) {
        use rayon::prelude::*;
        let (mut rest, mut passed) = (items, 0);
        let mut parts = Vec::with_capacity(self.ranges.len());
        for range in self.ranges.drain(..).rev() {
            let (own, others) = rest[range.first - passed..].split_at_mut(range.group.count);
            passed = range.first + range.group.count;
            parts.push((range, own));
            rest = others;
        }
        let shape_one = |(range, items): (Range, &mut [BuildItem])| {
            let mut shaping = Self { ranges: vec![Range { first: 0, ..range }], ..Self::default() };
            shaping.ranges[0].place = NO_PARENT;
            shaping.reserve(items.len());
            shaping.finish(items);
            (range.place, shaping.nodes)
        };
        let subtrees: Vec<(u32, Vec<ShapeNode>)> = parts.into_par_iter().map(shape_one).collect();
        for (place, nodes) in subtrees {
            let base = self.nodes.len() as u32;
            self.nodes.extend(nodes.into_iter().map(|node| node.moved(base)));
            self.link(base as usize, place);
        }
    }

    /// Records that a node is the child at a place.
    fn link(&mut self, node: usize, place: u32) {
        self.nodes[node].parent = place;
        if place != NO_PARENT {
            self.nodes[place as usize / WIDTH].children[place as usize % WIDTH] = node as u32;
        }
    }

    /// Does a step: begins a node, or splits a group, on about `most` items. Returns the ticks.
    pub fn advance(&mut self, items: &mut [BuildItem], most: usize) -> usize {
        let Self { choice, chooser, split, .. } = self;
        let Some(Choice { range, splitting, .. }) = choice else { return self.begin(items) };
        let Some(place) = splitting.or_else(|| chooser.next_split()) else { return self.finish_choice(items) };
        let (group, halve) = (*chooser.group(place), range.depth >= MAX_COST_DEPTH);
        let items = &mut items[range.first + chooser.first_light(place)..][..group.count];
        let mut ticks = 0;
        let parts = if group.count < MIN_STEPPED {
            ticks += whole_split_ticks(group.count);
            Some(split_at_once(items, &group, halve))
        } else {
            let split = split.get_or_insert_with(|| Box::new(Splitting::new()));
            if splitting.is_none() {
                split.start(&group, halve);
                *splitting = Some(place);
            }
            split.advance(items, &group, most, &mut ticks)
        };
        if let Some(parts) = parts {
            chooser.replace(place, &parts, &range.group, |_| false);
            *splitting = None;
        }
        ticks
    }

    /// Begins the node over the next range, and completes it if it has leaves only. Returns the ticks.
    fn begin(&mut self, items: &[BuildItem]) -> usize {
        let Some(range) = self.ranges.pop() else { return 0 };
        let node = self.nodes.len();
        self.nodes.push(ShapeNode::EMPTY);
        self.link(node, range.place);
        if range.group.count <= WIDTH {
            self.nodes[node].push_leaves(&items[range.first..][..range.group.count]);
        } else {
            self.chooser.start(&range.group);
            self.choice = Some(Choice { node, range, splitting: None });
        }
        NODE_TICKS
    }

    /// Completes the node whose children are chosen. Returns the ticks.
    fn finish_choice(&mut self, items: &[BuildItem]) -> usize {
        let before = self.nodes.len();
        if let Some(Choice { node, range, .. }) = self.choice.take() {
            range.list_children(node, self.chooser.children(), items, &mut self.nodes, &mut self.ranges);
        }
        NODE_TICKS * (1 + self.nodes.len() - before)
    }
}

impl Range {
    /// Gives the node over this range its children, of which some are inlined, and lists their ranges.
    fn list_children<'g>(
        &self,
        node: usize,
        children: impl Iterator<Item = (&'g Group, bool)>,
        items: &[BuildItem],
        nodes: &mut Vec<ShapeNode>,
        ranges: &mut Vec<Self>,
    ) {
        let (listed, mut first) = (ranges.len(), self.first);
        for (group, is_inlined) in children {
            let own = &items[first..][..group.count];
            let place = (node * WIDTH) as u32 + nodes[node].count;
            if is_inlined || group.count == 1 {
                nodes[node].push_leaves(own);
            } else if group.count <= WIDTH && ranges.len() == listed {
                // No range comes before it, so it need not wait. Most nodes are made here.
                let leaves = nodes.len() as u32;
                nodes[node].push(leaves);
                nodes.push(ShapeNode { parent: place, ..ShapeNode::EMPTY });
                nodes[leaves as usize].push_leaves(own);
            } else {
                nodes[node].push(EMPTY_SLOT);
                ranges.push(Self { group: *group, first, depth: self.depth + 1, place });
            }
            first += group.count;
        }
        ranges[listed..].reverse();
    }
}

/// Shapes a tree over some items and sorts them into the order of its leaves. The result does not
/// depend on the number of threads. O(n log n).
pub(crate) fn shape(items: &mut [BuildItem]) -> Vec<ShapeNode> {
    let mut shaping = Shaping::default();
    if !items.is_empty() {
        shaping.reserve(items.len());
        shaping.sum(items, usize::MAX);
        shaping.start();
        shaping.finish(items);
    }
    shaping.nodes
}

/// Slightly more nodes than most shapes need: nodes usually hold 5.5 to 6 lights.
fn likely_nodes(items: usize) -> usize {
    items / 5 + 1
}

impl ShapeNode {
    pub(super) const EMPTY: Self = Self { children: [EMPTY_SLOT; WIDTH], count: 0, parent: NO_PARENT };

    pub(super) fn push(&mut self, child: u32) {
        self.children[self.count as usize] = child;
        self.count += 1;
    }

    fn push_leaves(&mut self, items: &[BuildItem]) {
        items.iter().for_each(|item| self.push(LEAF | item.index()));
    }

    /// The node in a list that has `base` nodes before its own.
    #[cfg(feature = "parallel")]
    fn moved(mut self, base: u32) -> Self {
        let inner = self.children.iter_mut().filter(|child| **child & LEAF == 0);
        inner.for_each(|child| *child += base);
        if self.parent != NO_PARENT {
            self.parent += base * WIDTH as u32;
        }
        self
    }
}

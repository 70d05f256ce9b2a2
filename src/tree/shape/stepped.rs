//! Shapes a tree in small steps. The shape has the same bits as that of [`shape()`](super::shape).
//!
//! Nodes are completed depth first, on a stack of their own instead of by recursion. Small subtrees
//! are shaped by the functions of the parent module, and splits of many items are cut into pieces.

use super::group::{BuildItem, Group, SumsOfRuns};
use super::sides::sides;
use super::split::split;
use super::stepped_split::{MIN_STEPPED, SteppedSplit};
use super::{ChildChooser, Children, CostedGroup, MAX_COST_DEPTH, ShapeNode, likely_nodes, link_children, shape_below};
use crate::tree::units::{NODE_TICKS, SUM_TICKS, small_subtree_ticks, whole_split_ticks};

/// Subtrees of up to this many items are shaped at once, which takes about a microsecond.
const MAX_SMALL: usize = 24;

/// Deeper trees allocate more memory.
const LIKELY_DEPTH: usize = 16;

/// A shape in the making.
pub(in crate::tree) struct SteppedShape {
    items: Vec<BuildItem>,
    /// As [`shape_below`] makes them.
    nodes: Vec<ShapeNode>,
    whole: SumsOfRuns<Group>,
    /// The nodes that are not complete: each one below the one before it.
    unfinished: Vec<Unfinished>,
    split: SteppedSplit,
    sides: usize,
}

/// A node that is not complete.
struct Unfinished {
    /// Its index among the nodes.
    node: usize,
    depth: u32,
    /// The first item that is below the node and not below one of its complete children.
    first: usize,
    phase: ShapePhase,
}

/// What an unfinished node needs next.
enum ShapePhase {
    /// Choose the children of the group `whole`. `splitting` is the place of the group that is
    /// being split in steps.
    Choose { whole: Group, chooser: ChildChooser<CostedGroup>, splitting: Option<usize> },
    /// Shape the children from the place `next` on.
    Shape { children: Children<CostedGroup>, next: usize },
}

impl SteppedShape {
    pub fn new() -> Self {
        Self {
            items: Vec::new(),
            nodes: Vec::new(),
            whole: SumsOfRuns::new(Group::EMPTY, Group::EMPTY),
            unfinished: Vec::new(),
            split: SteppedSplit::new(),
            sides: 0,
        }
    }

    /// Reserves memory for the items.
    pub fn reserve_items(&mut self, count: usize) {
        self.items.reserve_exact(count);
    }

    /// Reserves memory for the nodes over `count` items.
    pub fn reserve_nodes(&mut self, count: usize) {
        self.nodes.reserve_exact(likely_nodes(count));
        self.unfinished.reserve_exact(LIKELY_DEPTH);
    }

    /// Appends an item.
    #[inline(always)]
    pub fn push(&mut self, item: BuildItem) {
        self.items.push(item);
    }

    /// The nodes. They name their children by distance until [`SteppedShape::link_children`].
    pub fn nodes(&self) -> &[ShapeNode] {
        &self.nodes
    }

    /// Links a node with its children. Parents come first.
    #[inline(always)]
    pub fn link_children(&mut self, node: usize) {
        link_children(&mut self.nodes, node);
    }

    /// Adds up to `max_items` more items to the sums over all. Returns the ticks.
    pub fn sum(&mut self, max_items: usize) -> usize {
        SUM_TICKS * self.whole.add_some(&self.items, max_items, Group::add_items)
    }

    /// Whether all items are part of the sums.
    pub fn has_sums(&self) -> bool {
        self.whole.added() == self.items.len()
    }

    /// Starts the shape over the items, of which there is at least one. Returns the ticks.
    pub fn start(&mut self) -> usize {
        if let Some(children) = sides(&mut self.items) {
            self.sides = children.len();
            self.nodes.push(ShapeNode::EMPTY);
            self.unfinished.push(Unfinished {
                node: 0,
                depth: 0,
                first: 0,
                phase: ShapePhase::Shape { children, next: 0 },
            });
            return whole_split_ticks(self.items.len());
        }
        let whole = *self.whole.get();
        self.begin(0, &whole, 0)
    }

    /// The number of sides, which are the children of the root; 0 if the tree is not divided.
    pub fn sides(&self) -> usize {
        self.sides
    }

    /// Whether all nodes are complete.
    pub fn is_done(&self) -> bool {
        self.unfinished.is_empty()
    }

    /// Starts the subtree over the items of `group`, the first of which is `first`. Completes it if
    /// it is small. Returns the ticks.
    fn begin(&mut self, first: usize, group: &Group, depth: u32) -> usize {
        if group.count <= MAX_SMALL {
            shape_below(&mut self.items[first..][..group.count], group, depth, &mut self.nodes);
            return small_subtree_ticks(group.count);
        }
        let node = self.nodes.len();
        self.nodes.push(ShapeNode::EMPTY);
        let chooser = ChildChooser::new(CostedGroup::whole(group));
        let phase = ShapePhase::Choose { whole: *group, chooser, splitting: None };
        self.unfinished.push(Unfinished { node, depth, first, phase });
        NODE_TICKS
    }

    /// Advances the lowest unfinished node. Returns the ticks.
    pub fn advance(&mut self) -> usize {
        let Some(top) = self.unfinished.last_mut() else { return 0 };
        match &mut top.phase {
            ShapePhase::Choose { whole, chooser, splitting } => {
                let halve = top.depth >= MAX_COST_DEPTH;
                let Some(place) = splitting.or_else(|| chooser.next_split()) else {
                    top.phase = ShapePhase::Shape { children: chooser.finish(), next: 0 };
                    return NODE_TICKS;
                };
                let group = chooser.group(place).group;
                let items = &mut self.items[top.first + chooser.first_light(place)..][..group.count];
                let mut ticks = 0;
                let parts = if group.count < MIN_STEPPED {
                    ticks += whole_split_ticks(group.count);
                    Some(split(items, &group, halve))
                } else {
                    if splitting.is_none() {
                        self.split.start(&group, halve);
                        *splitting = Some(place);
                    }
                    self.split.advance(items, &group, &mut ticks)
                };
                if let Some(parts) = parts {
                    chooser.replace(place, &CostedGroup::parts(whole, &parts));
                    *splitting = None;
                }
                ticks
            }
            ShapePhase::Shape { children, next } => {
                let place = *next;
                *next += 1;
                let Some((child, is_inlined)) = children.get(place) else {
                    self.nodes[top.node].span = (self.nodes.len() - top.node) as u32;
                    self.unfinished.pop();
                    return NODE_TICKS;
                };
                let first = top.first;
                top.first += child.group.count;
                if is_inlined || child.group.count == 1 {
                    self.nodes[top.node].push_leaves(&self.items[first..top.first]);
                    return NODE_TICKS;
                }
                let distance = self.nodes.len() - top.node;
                self.nodes[top.node].push(distance as u32);
                let (group, depth) = (child.group, top.depth + 1);
                self.begin(first, &group, depth)
            }
        }
    }
}

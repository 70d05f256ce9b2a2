//! Builds a tree in small steps, for builds that are spread over several frames.
//!
//! All pieces of work are those of [`LightTree::build`], in an order that does not change the
//! result: the finished tree has the same bits. No piece takes much longer than a microsecond,
//! except that the operating system may take longer to allocate an array of megabytes. `units.rs`
//! has the work that each piece counts.

use std::fmt;

use super::LightTree;
use super::attributes::AttributeSums;
use super::build::count_effects;
use super::layout::{PlacedLight, build_item};
use super::node::{NO_LEAF, Node};
use super::refitted::RefittedNodes;
use super::shape::SteppedShape;
use super::units::{
    ALLOCATE_TICKS, REFIT_TICKS, TASK_TICKS, UNIT, build_units, copy_ticks, lay_out_ticks, place_ticks,
};
use super::wide::WideCluster;
use crate::cluster::{Cluster, Linear};
use crate::light::Light;

/// Lights that are copied at once.
const LIGHTS_PER_COPY: usize = 64;

/// Lights whose clusters are computed at once.
const LIGHTS_PER_PIECE: usize = 16;

/// Lights that are summed at once.
const LIGHTS_PER_SUM: usize = 64;

/// Nodes that are laid out, or refitted, at once.
const NODES_PER_PIECE: usize = 2;

/// Refit tasks that are listed at once.
const TASKS_PER_PIECE: usize = 8;

/// No piece of work has more units than this, so no step exceeds its limit by more.
pub(crate) const MAX_EXTRA_UNITS: usize = 64;

/// A build of a tree that can stop after any piece of work and go on later.
pub(crate) struct TreeBuild {
    /// The number of lights.
    count: usize,
    phase: BuildPhase,
    /// The lights, nodes or entries that the phase has handled.
    next: usize,
    tree: LightTree,
    /// The clusters of the lights.
    placed: Vec<PlacedLight>,
    /// `None` before the first step.
    shape: Option<Box<SteppedShape>>,
    /// The ticks of all steps.
    ticks: usize,
}

/// What a build does next.
#[derive(Clone, Copy, Debug, PartialEq)]
enum BuildPhase {
    /// Allocate the arrays for the lights.
    AllocateLights,
    /// Copy the lights.
    Copy,
    /// Compute the clusters of the lights.
    Place,
    /// Sum all lights.
    Sum,
    /// Shape the tree.
    Shape,
    /// Allocate the arrays for the nodes.
    AllocateNodes,
    /// Lay out the nodes.
    LayOut,
    /// List the refit tasks.
    ListTasks,
    /// Refit the nodes, the last node first.
    Refit,
    Done,
}

impl TreeBuild {
    /// Starts a build over `lights` lights, for the map `reference` as [`LightTree::build_for`].
    /// O(1), allocates nothing but that map.
    pub fn new(lights: usize, reference: Option<&Linear>) -> Self {
        Self {
            count: lights,
            phase: if lights == 0 { BuildPhase::Done } else { BuildPhase::AllocateLights },
            next: 0,
            tree: LightTree {
                reference: reference.map(|map| Box::new(*map)),
                weights: reference.map(|map| Box::new(*map)),
                ..LightTree::default()
            },
            placed: Vec::new(),
            shape: None,
            ticks: 0,
        }
    }

    /// Works for at least `max_units` units unless it is done before, and for at most
    /// [`MAX_EXTRA_UNITS`] more. Returns the units of the step. A step does at least one piece of
    /// work, which may count less than one unit.
    ///
    /// `lights` are the present lights. Each is copied once, in order of its index. None is read
    /// once [`TreeBuild::has_all_lights`] is true.
    pub fn step(&mut self, lights: &[Light], max_units: usize) -> usize {
        self.step_while(lights, max_units, |build| !build.is_done())
    }

    /// [`TreeBuild::step`] that ends once all lights have been copied.
    pub fn copy_lights(&mut self, lights: &[Light], max_units: usize) -> usize {
        self.step_while(lights, max_units, |build| !build.has_all_lights())
    }

    fn step_while(&mut self, lights: &[Light], max_units: usize, goes_on: impl Fn(&Self) -> bool) -> usize {
        let before = self.ticks / UNIT;
        let limit = before.saturating_add(max_units).saturating_mul(UNIT);
        while goes_on(self) {
            self.ticks += self.advance(lights);
            if self.ticks >= limit {
                break;
            }
        }
        self.ticks / UNIT - before
    }

    /// Whether all lights have been copied.
    pub fn has_all_lights(&self) -> bool {
        self.tree.lights.len() == self.count
    }

    /// Whether the tree is finished.
    pub fn is_done(&self) -> bool {
        self.phase == BuildPhase::Done
    }

    /// An estimate of the units that are left. 0 if the tree is finished, and at least 1 before.
    pub fn units_left(&self) -> usize {
        let ticks = match self.phase {
            BuildPhase::Done => return 0,
            // A build of other than random lights may take more than the estimate.
            BuildPhase::AllocateLights | BuildPhase::Copy | BuildPhase::Place | BuildPhase::Sum | BuildPhase::Shape => {
                let nodes = self.count.div_ceil(5);
                (UNIT * build_units(self.count)).saturating_sub(self.ticks).max(self.node_ticks(nodes))
            }
            BuildPhase::AllocateNodes => self.node_ticks(self.node_count()),
            BuildPhase::LayOut => self.node_ticks(self.node_count()) - lay_out_ticks(self.count) * self.next,
            BuildPhase::ListTasks => REFIT_TICKS * self.node_count(),
            BuildPhase::Refit => REFIT_TICKS * self.next,
        };
        (ticks / UNIT).max(1)
    }

    /// The finished tree. Frees the memory of the build, about 150 bytes per light.
    ///
    /// # Panics
    /// If the build is not done.
    pub fn into_tree(self) -> LightTree {
        assert!(self.is_done(), "the build of the tree is not done");
        self.tree
    }

    /// The nodes of the finished shape.
    fn node_count(&self) -> usize {
        self.shape.as_ref().map_or(0, |shape| shape.nodes().len())
    }

    /// The ticks of all phases from the lay-out on, for some nodes.
    fn node_ticks(&self, nodes: usize) -> usize {
        (lay_out_ticks(self.count) + REFIT_TICKS) * nodes
    }

    /// Does a piece of work. Returns its ticks.
    fn advance(&mut self, lights: &[Light]) -> usize {
        match self.phase {
            BuildPhase::AllocateLights => self.allocate_lights(),
            BuildPhase::Copy => self.copy(lights),
            BuildPhase::Place => self.place(),
            BuildPhase::Sum => {
                let shape = self.shape.as_mut().expect("the shape was allocated");
                if !shape.has_sums() {
                    return shape.sum(LIGHTS_PER_SUM);
                }
                let ticks = shape.start();
                let is_done = shape.is_done();
                self.begin(if is_done { BuildPhase::AllocateNodes } else { BuildPhase::Shape });
                ticks
            }
            BuildPhase::Shape => {
                let shape = self.shape.as_mut().expect("the shape was allocated");
                let ticks = shape.advance();
                if shape.is_done() {
                    self.begin(BuildPhase::AllocateNodes);
                }
                ticks
            }
            BuildPhase::AllocateNodes => self.allocate_nodes(),
            BuildPhase::LayOut => self.lay_out(),
            BuildPhase::ListTasks => self.list_tasks(),
            BuildPhase::Refit => self.refit(),
            BuildPhase::Done => 0,
        }
    }

    /// Starts a phase.
    fn begin(&mut self, phase: BuildPhase) {
        self.phase = phase;
        self.next = 0;
    }

    /// Allocates one of the arrays: for a large tree, each of them is a call of the operating
    /// system.
    fn allocate_lights(&mut self) -> usize {
        let count = self.count;
        let shape = self.shape.get_or_insert_with(|| Box::new(SteppedShape::new()));
        match self.next {
            0 => self.tree.lights.reserve_exact(count),
            1 => self.tree.leaves.reserve_exact(count),
            2 => self.placed.reserve_exact(count),
            3 => shape.reserve_items(count),
            _ => {
                shape.reserve_nodes(count);
                self.begin(BuildPhase::Copy);
                return ALLOCATE_TICKS;
            }
        }
        self.next += 1;
        ALLOCATE_TICKS
    }

    fn copy(&mut self, lights: &[Light]) -> usize {
        let first = self.tree.lights.len();
        let end = self.count.min(first + LIGHTS_PER_COPY);
        self.tree.lights.extend_from_slice(&lights[first..end]);
        if end == self.count {
            self.begin(BuildPhase::Place);
        }
        copy_ticks(self.count) * (end - first)
    }

    fn place(&mut self) -> usize {
        let Self { count, next, tree, placed, shape, .. } = self;
        let shape = shape.as_mut().expect("the shape was allocated");
        let (first, end) = (*next, (*count).min(*next + LIGHTS_PER_PIECE));
        for (index, light) in (first..end).zip(&tree.lights[first..end]) {
            if light.is_removed() {
                tree.edited.set_vacant(index as u32, true);
                continue;
            }
            let light_in_place = PlacedLight::new(index, light);
            let reference = tree.reference.as_deref();
            shape.push(build_item(&light_in_place.cluster, placed.len() as u32, reference));
            placed.push(light_in_place);
            count_effects(&mut tree.effects, light);
        }
        tree.leaves.resize(end, NO_LEAF);
        *next = end;
        if end == self.count {
            self.begin(if self.placed.is_empty() { BuildPhase::Done } else { BuildPhase::Sum });
        }
        place_ticks(self.count) * (end - first)
    }

    /// Allocates one of the arrays of the tree.
    fn allocate_nodes(&mut self) -> usize {
        let count = self.node_count();
        let tree = &mut self.tree;
        match self.next {
            0 => tree.nodes.reserve_exact(count),
            1 => tree.refit_data.wide.reserve_exact(count),
            2 => tree.spans.reserve_exact(count),
            3 => tree.light_counts.reserve_exact(count),
            4 => tree.refit_data.attribute_sums.reserve_exact(count),
            _ => {
                tree.refit_data.dirty.reserve(count);
                tree.refit_data.refitted = RefittedNodes::empty(count);
                self.begin(BuildPhase::LayOut);
                return ALLOCATE_TICKS;
            }
        }
        self.next += 1;
        ALLOCATE_TICKS
    }

    fn lay_out(&mut self) -> usize {
        let count = self.node_count();
        let (first, end) = (self.next, count.min(self.next + NODES_PER_PIECE));
        let Self { tree, placed, shape, .. } = self;
        let shape = shape.as_mut().expect("the shape was allocated");
        tree.nodes.resize(end, Node::EMPTY);
        tree.refit_data.wide.resize(end, WideCluster::EMPTY);
        tree.spans.resize(end, 0);
        tree.light_counts.resize(end, 0);
        tree.refit_data.attribute_sums.resize(end, AttributeSums::default());
        tree.refit_data.dirty.grow(end);
        for node in first..end {
            shape.link_children(node);
            tree.lay_out_node(&shape.nodes()[node], node, placed);
        }
        self.next = end;
        if end == count {
            self.begin(BuildPhase::ListTasks);
        }
        lay_out_ticks(self.count) * (end - first)
    }

    fn list_tasks(&mut self) -> usize {
        let LightTree { refit_data, spans, .. } = &mut self.tree;
        let mut added = 0;
        while self.next < spans.len() && added < TASKS_PER_PIECE {
            self.next = refit_data.tasks.add(self.next, spans);
            added += 1;
        }
        if self.next == spans.len() {
            let nodes = spans.len();
            self.begin(BuildPhase::Refit);
            self.next = nodes;
        }
        TASK_TICKS * added
    }

    fn refit(&mut self) -> usize {
        let nodes = self.next.saturating_sub(NODES_PER_PIECE)..self.next;
        nodes.clone().rev().for_each(|node| self.tree.count_lights(node));
        self.tree.refit_nodes(nodes.clone());
        self.next = nodes.start;
        if self.next == 0 {
            let sides = self.shape.as_ref().map_or(0, |shape| shape.sides());
            self.tree.sides = vec![Cluster::EMPTY; sides].into();
            self.tree.finish_build();
            self.begin(BuildPhase::Done);
        }
        REFIT_TICKS * nodes.len()
    }
}

impl fmt::Debug for TreeBuild {
    /// Summarises the build: its arrays may be megabytes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TreeBuild")
            .field("lights", &self.count)
            .field("phase", &self.phase)
            .field("next", &self.next)
            .field("units_done", &(self.ticks / UNIT))
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests;

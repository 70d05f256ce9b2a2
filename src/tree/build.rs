//! Builds a tree over lights, by a build that can stop after any step.
//!
//! `tree/shape/` divides the lights by cost, from the root down (docs/math.md, "Building a tree").
//! Then the nodes are laid out depth first, with the clusters of the lights, and a refit computes the
//! rest. A build can stop after any piece of work and go on later on any thread, or run to its end at
//! once, with rayon's threads. The tree has the same bits in all cases. No piece of a step takes much
//! longer than a microsecond, except that the operating system may take longer to allocate an array of
//! megabytes. `units.rs` has the work that each piece counts.

use std::collections::BTreeSet;
use std::fmt;

use super::attributes::AttributeSums;
use super::edited::Edited;
use super::node::{EMPTY_SLOT, LEAF, NO_LEAF, Node, WIDTH};
use super::placed::{PlacedLight, build_item};
use super::shape::{BuildItem, ShapeNode, Shaping};
use super::state::{RefitData, TreeState};
use super::units::{
    ALLOCATE_TICKS, REFIT_TICKS, SUM_TICKS, UNIT, build_units, copy_ticks, lay_out_ticks, place_ticks,
    whole_split_ticks,
};
use super::wide::WideCluster;
use super::{LightTree, Maps};
use crate::cluster::{Cluster, Linear};
use crate::effects::EffectCounts;
use crate::light::Light;
use crate::rare::Rare;

/// Lights that are copied in a piece.
const LIGHTS_PER_COPY: usize = 64;

/// Lights whose clusters are computed in a piece.
const LIGHTS_PER_PIECE: usize = 16;

/// Items that are handled in a piece: summed, binned, counted or moved.
const ITEMS_PER_PIECE: usize = 64;

/// Nodes that are laid out, or refitted, in a piece.
const NODES_PER_PIECE: usize = 2;

/// The clusters of more lights than this are computed by several threads; for fewer, waking a
/// thread costs more than it saves.
#[cfg(feature = "parallel")]
const PARALLEL_LIGHTS: usize = 4096;

/// No piece of work has more units than this, so no step exceeds its limit by more.
pub(crate) const MAX_EXTRA_UNITS: usize = 64;

/// A build of a tree that can stop after any piece of work and go on later.
pub(crate) struct TreeBuild {
    /// The number of lights.
    count: usize,
    phase: BuildPhase,
    /// The lights or nodes that the phase has handled.
    next: usize,
    tree: LightTree,
    /// The clusters of the lights.
    placed: Vec<PlacedLight>,
    items: Vec<BuildItem>,
    shaping: Shaping,
    /// The ticks of all steps.
    ticks: usize,
}

/// What a build does next.
#[derive(Clone, Copy, Debug, PartialEq)]
enum BuildPhase {
    /// Allocate the arrays for the lights.
    Allocate,
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
    /// Refit the nodes, the last node first.
    Refit,
    Done,
}

impl LightTree {
    /// Builds a tree over valid lights.
    #[cfg(test)]
    pub(crate) fn build(lights: Vec<Light>) -> Self {
        Self::build_for(lights, None, BTreeSet::new())
    }

    /// Builds a tree over valid lights that is shaped as its image under `reference` would be. The
    /// indices in `vacant` have no light.
    pub(crate) fn build_for(lights: Vec<Light>, reference: Option<Box<Linear>>, vacant: BTreeSet<u32>) -> Self {
        let mut build = TreeBuild::new(lights.len(), None);
        build.tree =
            Self { lights, maps: Maps::of_build(reference), edited: Edited::of_build(vacant), ..Self::default() };
        build.finish()
    }
}

impl TreeBuild {
    /// Starts a build over `lights` lights, for the map `reference` as [`LightTree::build_for`].
    /// O(1), allocates nothing but that map.
    pub fn new(lights: usize, reference: Option<&Linear>) -> Self {
        Self {
            count: lights,
            phase: if lights == 0 { BuildPhase::Done } else { BuildPhase::Allocate },
            next: 0,
            tree: LightTree { maps: Maps::of_build(reference.map(|map| Box::new(*map))), ..LightTree::default() },
            placed: Vec::new(),
            items: Vec::new(),
            shaping: Shaping::default(),
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
            self.ticks += self.advance(lights, false);
            if self.ticks >= limit {
                break;
            }
        }
        self.ticks / UNIT - before
    }

    /// Does the rest of a build that has all its lights, with rayon's threads if that is much. Returns
    /// the tree.
    pub fn finish(mut self) -> LightTree {
        while !self.is_done() {
            self.advance(&[], true);
        }
        self.tree
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
        let nodes = self.shaping.nodes.len();
        let ticks = match self.phase {
            BuildPhase::Done => return 0,
            BuildPhase::AllocateNodes => self.node_ticks(nodes),
            BuildPhase::LayOut => self.node_ticks(nodes) - lay_out_ticks(self.count) * self.next,
            BuildPhase::Refit => REFIT_TICKS * self.next,
            // A build of other than random lights may take more than the estimate.
            _ => {
                let nodes = self.count.div_ceil(5);
                (UNIT * build_units(self.count)).saturating_sub(self.ticks).max(self.node_ticks(nodes))
            }
        };
        (ticks / UNIT).max(1)
    }

    /// The ticks of all phases from the lay-out on, for some nodes.
    fn node_ticks(&self, nodes: usize) -> usize {
        (lay_out_ticks(self.count) + REFIT_TICKS) * nodes
    }

    /// Does a piece of work, or all of its phase if `at_once`. Returns its ticks.
    fn advance(&mut self, lights: &[Light], at_once: bool) -> usize {
        let piece = |size: usize| if at_once { usize::MAX } else { size };
        match self.phase {
            BuildPhase::Allocate => self.allocate(),
            BuildPhase::Copy => self.copy(lights),
            BuildPhase::Place => self.place(piece(LIGHTS_PER_PIECE)),
            BuildPhase::Sum => self.sum(piece(ITEMS_PER_PIECE)),
            BuildPhase::Shape => self.shape(at_once),
            BuildPhase::AllocateNodes => self.allocate_nodes(),
            BuildPhase::LayOut => self.lay_out(piece(NODES_PER_PIECE)),
            BuildPhase::Refit => self.refit(at_once),
            BuildPhase::Done => 0,
        }
    }

    /// Starts a phase.
    fn begin(&mut self, phase: BuildPhase, next: usize) {
        (self.phase, self.next) = (phase, next);
    }

    /// Allocates the arrays for the lights.
    fn allocate(&mut self) -> usize {
        let Self { count, tree, .. } = self;
        tree.lights.reserve_exact(*count - tree.lights.len());
        tree.leaves.reserve_exact(*count);
        self.placed.reserve_exact(*count);
        self.items.reserve_exact(*count);
        self.shaping.reserve(*count);
        self.begin(if self.has_all_lights() { BuildPhase::Place } else { BuildPhase::Copy }, 0);
        5 * ALLOCATE_TICKS
    }

    fn copy(&mut self, lights: &[Light]) -> usize {
        let first = self.tree.lights.len();
        let end = self.count.min(first + LIGHTS_PER_COPY);
        self.tree.lights.extend_from_slice(&lights[first..end]);
        for (index, _) in (first..).zip(&lights[first..end]).filter(|(_, light)| light.is_removed()) {
            self.tree.edited.set_vacant(index as u32, true);
        }
        if end == self.count {
            self.begin(BuildPhase::Place, 0);
        }
        copy_ticks(self.count) * (end - first)
    }

    /// Computes the clusters and the items of some lights.
    fn place(&mut self, most: usize) -> usize {
        let Self { count, next, tree, placed, .. } = self;
        let (first, end, known) = (*next, (*count).min(next.saturating_add(most)), placed.len());
        let lights = &tree.lights[first..end];
        let place = |(index, light): (usize, &Light)| PlacedLight::new(first + index, light);
        let present = || lights.iter().enumerate().filter(|(_, light)| !light.is_removed());
        #[cfg(feature = "parallel")]
        if lights.len() > PARALLEL_LIGHTS && tree.edited.vacant().is_empty() {
            use rayon::prelude::*;
            placed.par_extend(lights.par_iter().enumerate().with_min_len(PARALLEL_LIGHTS).map(place));
        } else {
            placed.extend(present().map(place));
        }
        #[cfg(not(feature = "parallel"))]
        placed.extend(present().map(place));
        let item =
            |(number, light): (u32, &PlacedLight)| build_item(&light.cluster, number, tree.maps.reference.as_deref());
        self.items.extend((known as u32..).zip(&placed[known..]).map(item));
        present().for_each(|(_, light)| count_effects(&mut tree.effects, light));
        tree.leaves.resize(end, NO_LEAF);
        *next = end;
        if end == self.count {
            let phase = if self.placed.is_empty() { BuildPhase::Done } else { BuildPhase::Sum };
            self.begin(phase, 0);
        }
        place_ticks(self.count) * (end - first)
    }

    fn sum(&mut self, most: usize) -> usize {
        let added = self.shaping.sum(&self.items, most);
        if added > 0 {
            return SUM_TICKS * added;
        }
        self.shaping.start_tree(&mut self.items);
        self.begin(BuildPhase::Shape, 0);
        if self.shaping.sides > 0 { whole_split_ticks(self.items.len()) } else { 1 }
    }

    fn shape(&mut self, at_once: bool) -> usize {
        let ticks = if at_once {
            self.shaping.finish(&mut self.items);
            0
        } else {
            self.shaping.advance(&mut self.items, ITEMS_PER_PIECE)
        };
        if self.shaping.is_done() {
            self.begin(BuildPhase::AllocateNodes, 0);
        }
        ticks
    }

    /// Allocates the arrays for the nodes.
    fn allocate_nodes(&mut self) -> usize {
        let count = self.shaping.nodes.len();
        let tree = &mut self.tree;
        tree.nodes.reserve_exact(count);
        tree.light_counts.reserve_exact(count);
        tree.sides = vec![Cluster::EMPTY; self.shaping.sides].into();
        tree.state = TreeState::Live(Box::new(RefitData::with_room(count)));
        self.begin(BuildPhase::LayOut, 0);
        4 * ALLOCATE_TICKS
    }

    fn lay_out(&mut self, most: usize) -> usize {
        let Self { tree, placed, shaping, next, .. } = self;
        let (first, count) = (*next, shaping.nodes.len());
        let end = count.min(first.saturating_add(most));
        tree.nodes.resize(end, Node::EMPTY);
        tree.light_counts.resize(end, 0);
        tree.state.data_mut().wide.resize(end, WideCluster::EMPTY);
        tree.state.data_mut().attribute_sums.resize(end, AttributeSums::default());
        for node in first..end {
            tree.lay_out_node(&shaping.nodes[node], node, placed);
        }
        *next = end;
        if end == count {
            self.begin(BuildPhase::Refit, count);
        }
        lay_out_ticks(self.count) * (end - first)
    }

    fn refit(&mut self, at_once: bool) -> usize {
        let tree = &mut self.tree;
        let nodes = if at_once { 0 } else { self.next.saturating_sub(NODES_PER_PIECE) }..self.next;
        nodes.clone().rev().for_each(|node| tree.count_lights(node));
        if !at_once {
            tree.follow(nodes.end, nodes.len(), true);
        }
        self.next = nodes.start;
        if self.next == 0 {
            tree.finish_build();
            self.begin(BuildPhase::Done, 0);
        }
        REFIT_TICKS * nodes.len()
    }
}

impl LightTree {
    /// Lays out a node of a shape and marks it for the next refit.
    #[inline(always)]
    fn lay_out_node(&mut self, shaped: &ShapeNode, node: usize, lights: &[PlacedLight]) {
        let mut children = shaped.children;
        // Load all at once: they are anywhere in memory, and waiting for one after the other takes
        // longer than all the rest.
        let is_light = |child: u32| child != EMPTY_SLOT && child & LEAF != 0;
        let loaded: [PlacedLight; WIDTH] =
            children.map(|child| if is_light(child) { lights[(child & !LEAF) as usize] } else { PlacedLight::NONE });
        for (slot, child) in children[..shaped.count as usize].iter_mut().enumerate() {
            if *child & LEAF != 0 {
                let PlacedLight { index, cluster } = &loaded[slot];
                self.leaves[*index as usize] = (node * WIDTH + slot) as u32;
                self.state.data_mut().wide[node].set(slot, cluster);
                *child = index | LEAF;
            }
        }
        self.nodes[node] = Node { children, parent: shaped.parent, steps: shaped.count << 24, ..Node::EMPTY };
        self.state.data_mut().dirty.insert(node);
    }

    /// Counts the lights below a node whose child nodes have been counted.
    #[inline(always)]
    pub(super) fn count_lights(&mut self, node: usize) {
        self.light_counts[node] = self.nodes[node].children[..self.nodes[node].count()]
            .iter()
            .map(|child| if child & LEAF != 0 { 1 } else { self.light_counts[*child as usize] })
            .sum();
    }

    /// Refits what is not up to date of a tree that was laid out, and computes what depends on all nodes.
    fn finish_build(&mut self) {
        self.follow_marked(true);
        self.quality.built_cost = self.quality.cost;
        self.state.data_mut().refitted.clear();
        if self.nodes.len() == 1 {
            self.state = TreeState::default();
        }
    }
}

/// Counts the effects of one more light.
pub(super) fn count_effects(counts: &mut Rare<EffectCounts>, light: &Light) {
    let effects = light.effects();
    if !effects.is_empty() {
        counts.add(effects);
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

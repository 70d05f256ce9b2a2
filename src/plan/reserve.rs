//! Finds out which buffers a frame needs, before anything is written.

use std::fmt;
use std::ops::Range;

use super::LightPlanner;
use super::buffers::{BufferId, NewBuffer};
use super::changes::{PendingChanges, Slots, TreeRanges};
use super::error::PlanError;
use super::layout::{ParamsRecord, PartRecord, TreeRecord};
use super::parts::NewParts;
use super::pool::Growth;
use super::previous::Copies;
use super::relayout::RELAYOUT_STRIDE;
use super::runs::runs;
use super::scatter::{self, RunCount};
use super::stored::Stored;
use crate::effects::Effects;
use crate::keys::slot_of;
use crate::world::{FrameDelta, LightWorld, TreeChanges};

/// Nodes that did not change are sent along if at most this many lie between two that did. That
/// saves a write.
const NODE_GAP: u32 = 2;
/// The same for lights.
const LIGHT_GAP: u32 = 8;

/// The room that the changes of a world need on the GPU. Make [`Reservation::new_buffers`], then
/// call [`Reservation::plan`].
///
/// Dropped without that, it changes nothing, and its changes belong to the next reservation.
pub struct Reservation<'a> {
    pub(super) planner: &'a mut LightPlanner,
    pub(super) world: &'a LightWorld,
    pub(super) changes: PendingChanges,
    pub(super) effects: Effects,
    pub(super) room: Room,
    /// The room was taken into use, so that there is nothing to undo.
    pub(super) is_used: bool,
}

/// What a frame needs before it changes anything.
#[derive(Debug, Default)]
pub(super) struct Room {
    /// Nothing has changed in what shaders read.
    pub is_idle: bool,
    pub new_buffers: Vec<NewBuffer>,
    /// New ranges for trees by slot, in ascending order; empty for a tree that was removed.
    pub placed: Vec<(u32, TreeRanges)>,
    /// New ranges for the parts of instances.
    pub parts: NewParts,
    /// The continuation of the table of instances.
    pub slots: Range<u32>,
    pub directionals: Option<Range<u32>>,
    pub trees: TreeRuns,
    /// The slots of the instances that are written, and their runs.
    pub instances: Slots,
    pub instance_runs: Vec<Range<u32>>,
    /// Which pools take their short runs from staged records: nodes, lights, trees, instances.
    pub is_scattered: [bool; scatter::MAX_TARGETS],
    pub staged_bytes: u64,
    pub params: Option<BufferId>,
    /// Copies of the present buffers, for shaders that read those of the last frame.
    pub copies: Copies,
    pub relayout_uniform: Option<BufferId>,
    pub scatter_uniform: Option<BufferId>,
    pub staging: Option<(BufferId, u64)>,
}

/// What is written of trees.
#[derive(Debug, Default)]
pub(super) struct TreeRuns {
    /// Runs of nodes and lights within their trees.
    pub runs: Vec<Range<u32>>,
    pub trees: Vec<TreeWrite>,
}

/// What is written of one tree: ranges of [`TreeRuns::runs`].
#[derive(Debug)]
pub(super) struct TreeWrite {
    pub slot: u32,
    pub nodes: Range<usize>,
    pub lights: Range<usize>,
}

impl Reservation<'_> {
    /// The buffers that the frame needs. Buffers of former frames stay in use.
    pub fn new_buffers(&self) -> &[NewBuffer] {
        &self.room.new_buffers
    }

    /// The slots of instances that were added, moved, changed or removed, in ascending order.
    #[cfg(feature = "gpu")]
    pub(crate) fn changed_instances(&self) -> &[u32] {
        self.changes.instances.as_slice()
    }
}

impl fmt::Debug for Reservation<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Reservation").field("new_buffers", &self.room.new_buffers).finish_non_exhaustive()
    }
}

impl Drop for Reservation<'_> {
    fn drop(&mut self) {
        if !self.is_used {
            self.planner.undo(std::mem::take(&mut self.room));
            self.planner.pending = std::mem::take(&mut self.changes);
        }
    }
}

impl LightPlanner {
    /// Finds out which buffers the GPU needs to follow `world`. Changes nothing that shaders read.
    ///
    /// Pass every delta that [`LightWorld::take_delta`] returns, in order. Pass
    /// [`FrameDelta::everything`](crate::FrameDelta::everything) first if the world was used before,
    /// and whenever a delta was left out. A tree that an instance needs and that was never sent is sent
    /// along. O(what changed).
    ///
    /// # Errors
    /// [`PlanError::Full`] if a buffer would outgrow [`PlanLimits`](super::PlanLimits). The changes
    /// of the delta are kept for the next call, which succeeds once the world holds less.
    pub fn reserve<'a>(&'a mut self, world: &'a LightWorld, delta: &FrameDelta) -> Result<Reservation<'a>, PlanError> {
        self.reserve_as(world, delta, world.effects(), Growth::Double)
    }

    /// As [`LightPlanner::reserve`], with buffers no larger than needed. An engine that has no
    /// memory for the buffers of `reserve` drops that reservation, and may try this.
    ///
    /// # Errors
    /// As [`LightPlanner::reserve`].
    pub fn reserve_exactly<'a>(
        &'a mut self,
        world: &'a LightWorld,
        delta: &FrameDelta,
    ) -> Result<Reservation<'a>, PlanError> {
        self.reserve_as(world, delta, world.effects(), Growth::Exact)
    }

    /// Reserves for the layout of these effects, which must contain the world's.
    pub(crate) fn reserve_as<'a>(
        &'a mut self,
        world: &'a LightWorld,
        delta: &FrameDelta,
        effects: Effects,
        growth: Growth,
    ) -> Result<Reservation<'a>, PlanError> {
        // No shader depends on whether lights move.
        let effects = effects - Effects::MOVING;
        let mut changes = std::mem::take(&mut self.pending);
        changes.add(delta);
        if self.is_lost {
            changes.add_everything(world);
            self.tree_ranges.iter_mut().for_each(|ranges| ranges.revision = 0);
            self.parts.lose_records();
            self.top.lose();
        }
        let mut room = Room::default();
        let present = if self.previous.is_kept { self.present() } else { None };
        room.copies = self.previous.reserve(present, (&mut self.ids, &mut room.new_buffers));
        let has_params = self.params_buffer.is_some() && self.params == self.params_of(world, effects);
        room.is_idle = changes.is_empty() && has_params;
        if !room.is_idle
            && let Err(error) = self.make_room((world, effects), &mut changes, growth, &mut room)
        {
            self.undo(room);
            self.pending = changes;
            return Err(error);
        }
        Ok(Reservation { planner: self, world, changes, effects, room, is_used: false })
    }

    /// Reserves room for everything that grew. To be undone if it fails.
    fn make_room(
        &mut self,
        (world, effects): (&LightWorld, Effects),
        changes: &mut PendingChanges,
        growth: Growth,
        room: &mut Room,
    ) -> Result<(), PlanError> {
        self.nodes.begin(Stored::nodes(effects))?;
        self.lights.begin(Stored::lights(effects))?;
        self.instances.begin(Stored::instances(effects))?;
        self.trees.begin(Stored::whole::<TreeRecord>())?;
        self.parts.pool().begin(Stored::whole::<PartRecord>())?;
        self.add_missing_trees(world, changes);
        self.place_trees(world, changes, growth, &mut room.placed)?;
        // The instances of trees that moved within the pools are written too.
        for (slot, _) in &room.placed {
            if let Some(entry) = world.tree_at(*slot).and_then(|key| world.tree_entry(key)) {
                changes.instances.extend(entry.instances.iter().map(|key| slot_of(*key)));
            }
        }
        changes.instances.sort();
        let slots = changes.instances.as_slice().iter();
        let counts: Vec<_> = slots.map(|slot| (*slot, self.part_count(*slot, world, &room.placed))).collect();
        room.parts = self.parts.reserve(counts.into_iter(), growth)?;
        // Nothing of the table is ever given back, so every reservation continues the last one.
        let more_slots = (world.slot_count() as u32).saturating_sub(self.instance_count);
        room.slots = self.instances.alloc(more_slots, growth)?;
        let directionals = world.directionals().count() as u32;
        if changes.directionals && directionals as usize != self.directionals.len() {
            room.directionals = Some(self.lights.alloc(directionals, growth)?);
        }
        let has_masks = effects.contains(Effects::MASKS);
        self.top.reserve(self.parts.count(), has_masks, growth, (&mut self.ids, &mut room.new_buffers))?;
        self.find_runs(world, changes, room);
        self.name_buffers(room);
        Ok(())
    }

    /// Adds the trees that changed instances need and that were never sent.
    fn add_missing_trees(&mut self, world: &LightWorld, changes: &mut PendingChanges) {
        for slot in changes.instances.as_slice().iter().chain(changes.user_data.as_slice()) {
            let tree = world.instance_at(*slot).and_then(|key| world.instance_tree(key));
            if let Some(tree) = tree
                && self.tree_ranges_mut(slot_of(tree)).key != Some(tree)
            {
                changes.trees.extend([slot_of(tree)]);
            }
        }
        changes.trees.sort();
    }

    /// Reserves ranges for the trees whose size has changed.
    fn place_trees(
        &mut self,
        world: &LightWorld,
        changes: &PendingChanges,
        growth: Growth,
        placed: &mut Vec<(u32, TreeRanges)>,
    ) -> Result<(), PlanError> {
        for slot in changes.trees.as_slice().iter().copied() {
            let key = world.tree_at(slot);
            let tree = key.and_then(|key| Some((world.tree(key)?, world.division(key))));
            match tree {
                Some((tree, division))
                    if self.tree_ranges_mut(slot).key == key && self.tree_ranges_mut(slot).fit(tree, division) => {}
                Some((tree, division)) => {
                    // Pushed first, so that what was reserved is released if the rest fails.
                    placed.push((slot, TreeRanges { key, division, ..TreeRanges::NONE }));
                    let ranges = placed.last_mut().map(|(_, ranges)| ranges).expect("pushed above");
                    let former = &self.tree_ranges[slot as usize];
                    let counts = [tree.nodes().len(), tree.lights().len()];
                    let [nodes, lights] =
                        if former.key == key { former.room_for(counts) } else { counts.map(|n| n as u32) };
                    ranges.nodes = self.nodes.alloc(nodes, growth)?;
                    ranges.lights = self.lights.alloc(lights, growth)?;
                    ranges.records = self.trees.alloc(TreeRecord::count(tree, division), growth)?;
                }
                None => placed.push((slot, TreeRanges::NONE)),
            }
        }
        Ok(())
    }

    /// The number of parts of the instance in a slot: as many as its tree has records, once the
    /// ranges in `placed` replace the present ones. 0 without an instance.
    fn part_count(&self, slot: u32, world: &LightWorld, placed: &[(u32, TreeRanges)]) -> u32 {
        let tree = world.instance_at(slot).and_then(|key| world.instance_tree(key));
        tree.map_or(0, |tree| self.ranges_after(slot_of(tree), placed).records.len() as u32)
    }

    /// The ranges of a tree once those in `placed` replace the present ones.
    fn ranges_after<'a>(&'a self, slot: u32, placed: &'a [(u32, TreeRanges)]) -> &'a TreeRanges {
        // In ascending order of slots.
        match placed.binary_search_by_key(&slot, |(slot, _)| *slot) {
            Ok(index) => &placed[index].1,
            Err(_) => &self.tree_ranges[slot as usize],
        }
    }

    /// Finds the runs of records that will be written, and decides which pools take them from staged
    /// records.
    fn find_runs(&self, world: &LightWorld, changes: &PendingChanges, room: &mut Room) {
        let [mut node_count, mut light_count, mut tree_count, mut instance_count] =
            [RunCount::default(); scatter::MAX_TARGETS];
        let found = &mut room.trees;
        let add = |runs: Vec<Range<u32>>, count: &mut RunCount, all: &mut Vec<Range<u32>>| {
            let start = all.len();
            runs.iter().for_each(|run| count.add(run));
            all.extend(runs);
            start..all.len()
        };
        for slot in changes.trees.as_slice().iter().copied() {
            let Some(entry) = world.tree_at(slot).and_then(|key| world.tree_entry(key)) else { continue };
            let ranges = self.ranges_after(slot, &room.placed);
            let (nodes, lights) = match entry.log.since(ranges.revision) {
                Some(TreeChanges { nodes, lights }) => (runs(nodes, NODE_GAP), runs(lights, LIGHT_GAP)),
                None => (all(entry.tree.nodes().len()), all(entry.tree.lights().len())),
            };
            let nodes = add(nodes, &mut node_count, &mut found.runs);
            let lights = add(lights, &mut light_count, &mut found.runs);
            tree_count.add(&ranges.records);
            found.trees.push(TreeWrite { slot, nodes, lights });
        }
        room.instances = changes.records();
        room.instance_runs = runs(room.instances.as_slice().iter().copied(), 0);
        room.instance_runs.iter().for_each(|run| instance_count.add(run));
        let staged = [
            self.nodes.staged_bytes(&node_count),
            self.lights.staged_bytes(&light_count),
            self.trees.staged_bytes(&tree_count),
            self.instances.staged_bytes(&instance_count),
        ];
        let bytes: u64 = staged.iter().sum();
        if bytes <= self.limits.largest_buffer {
            room.is_scattered = staged.map(|bytes| bytes > 0);
            room.staged_bytes = bytes;
        }
    }

    /// Gives numbers to the new buffers.
    fn name_buffers(&mut self, room: &mut Room) {
        let ids = &mut self.ids;
        let pools = [
            self.nodes.end(ids),
            self.lights.end(ids),
            self.instances.end(ids),
            self.trees.end(ids),
            self.parts.pool().end(ids),
        ];
        room.new_buffers.extend(pools.into_iter().flatten());
        let mut add = |buffer: NewBuffer| {
            room.new_buffers.push(buffer);
            buffer.id
        };
        let converts = self.nodes.has_conversion() || self.lights.has_conversion() || self.instances.has_conversion();
        if converts && self.relayout_uniform.is_none() {
            room.relayout_uniform = Some(add(ids.uniform("relayout", 3 * u64::from(RELAYOUT_STRIDE))));
        }
        if room.staged_bytes > 0 && self.scatter_uniform.is_none() {
            room.scatter_uniform = Some(add(ids.uniform("scatter", scatter::UNIFORM_BYTES)));
        }
        let staging = self.staging.map_or(0, |(_, bytes)| bytes);
        if room.staged_bytes > staging {
            let largest = self.limits.largest_buffer & !3;
            let bytes = room.staged_bytes.max(2 * staging).min(largest);
            room.staging = Some((add(ids.storage("staged records", bytes)), bytes));
        }
        // The former parameters belong to the former buffers.
        let is_replaced = self.top.is_replaced()
            || self.nodes.is_replaced()
            || self.instances.is_replaced()
            || self.lights.is_replaced();
        if is_replaced {
            room.params = Some(add(ids.uniform("sampling parameters", size_of::<ParamsRecord>() as u64)));
        }
    }

    /// Takes back what was reserved.
    fn undo(&mut self, room: Room) {
        room.placed.into_iter().for_each(|(_, ranges)| self.release(ranges));
        self.parts.release(room.parts);
        self.instances.free(room.slots);
        room.directionals.into_iter().for_each(|range| self.lights.free(range));
        self.nodes.undo();
        self.lights.undo();
        self.instances.undo();
        self.trees.undo();
        self.parts.pool().undo();
        self.top.undo();
    }
}

/// A run of all records of a tree.
fn all(count: usize) -> Vec<Range<u32>> {
    std::iter::once(0..count as u32).filter(|run| !run.is_empty()).collect()
}

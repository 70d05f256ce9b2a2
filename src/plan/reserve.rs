//! Finds out which buffers a frame needs, before anything is written.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;

use super::LightPlanner;
use super::buffers::NewBuffer;
use super::changes::PendingChanges;
use super::error::PlanError;
use super::layout::{ParamsRecord, PartRecord, TreeRecord};
use super::pool::Growth;
use super::relayout::RELAYOUT_STRIDE;
use super::residency::{Incoming, TreeState};
use super::room::{Restarted, ReusedLists, Room};
use super::runs::add_runs;
use super::scatter::{self, RunCount};
use super::stored::Stored;
use super::tree_writes::written_records;
use crate::effects::Effects;
use crate::keys::slot_of;
use crate::world::{FrameDelta, LightWorld};

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

impl Reservation<'_> {
    /// The buffers that the frame needs. Buffers of former frames stay in use.
    pub fn new_buffers(&self) -> &[NewBuffer] {
        &self.room.new_buffers
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
            self.residency.lose();
            self.parts.lose_records();
            self.top.lose();
        }
        let has_params = self.params_buffer.is_some() && self.params == self.params_of(world, effects);
        let is_idle = changes.is_empty() && has_params && !self.has_work();
        self.divide_memory(world, effects);
        let mut room = self.new_room(growth);
        room.is_idle = is_idle;
        let mut result = if is_idle { Ok(()) } else { self.make_room((world, effects), &mut changes, &mut room) };
        if result.is_err() {
            // Without gaps, and with stand-ins in place of the less useful trees, they may fit.
            self.undo(std::mem::take(&mut room));
            let mut everything = changes.clone();
            everything.add_everything(world);
            room = self.new_room(growth);
            room.restarted = Some(self.restart(world, effects));
            result = self.make_room((world, effects), &mut everything, &mut room);
            if result.is_ok() {
                changes = everything;
            }
        }
        if let Err(error) = result {
            self.undo(room);
            self.pending = changes;
            return Err(error);
        }
        Ok(Reservation { planner: self, world, changes, effects, room, is_used: false })
    }

    /// Whether trees wait that this frame may send.
    fn has_work(&self) -> bool {
        let may_send = self.limits.frame_bytes != Some(0);
        let has_waiting = self.residency.waiting_count() > 0 || self.residency.incoming.is_some();
        has_waiting && may_send || self.is_resized || self.may_join_gaps()
    }

    fn new_room(&mut self, growth: Growth) -> Room {
        let ReusedLists { trees, instance_runs } = std::mem::take(&mut self.lists);
        let mut room = Room { growth, trees, instance_runs, ..Room::default() };
        let present = if self.previous.is_kept { self.present() } else { None };
        room.copies = self.previous.reserve(present, (&mut self.ids, &mut room.new_buffers));
        room
    }

    /// Forgets where trees are, so that all of them are placed anew.
    fn restart(&mut self, world: &LightWorld, effects: Effects) -> Box<Restarted> {
        let restarted = Restarted {
            nodes: self.nodes.restart(),
            lights: self.lights.restart(),
            residency: self.residency.restart(),
            directionals: std::mem::take(&mut self.directionals),
        };
        self.shares = None;
        self.divide_memory(world, effects);
        Box::new(restarted)
    }

    /// Reserves room for everything that grew. To be undone if it fails.
    fn make_room(
        &mut self,
        (world, effects): (&LightWorld, Effects),
        changes: &mut PendingChanges,
        room: &mut Room,
    ) -> Result<(), PlanError> {
        let growth = room.growth;
        self.nodes.begin(Stored::nodes(effects))?;
        self.lights.begin(Stored::lights(effects))?;
        self.instances.begin(Stored::instances(effects))?;
        self.trees.begin(Stored::whole::<TreeRecord>())?;
        self.parts.pool().begin(Stored::whole::<PartRecord>())?;
        self.add_missing_trees(world, changes);
        self.place_trees(world, changes, room)?;
        self.add_placed_instances(world, room, changes);
        let directionals = world.directional_count() as u32;
        if changes.directionals && directionals as usize != self.directionals.len() {
            room.directionals = Some(self.lights.alloc(directionals, growth)?);
        }
        let slots = changes.instances.as_slice().iter();
        let counts: Vec<_> = slots.map(|slot| (*slot, self.part_count(*slot, world, &room.placed))).collect();
        room.parts = self.parts.reserve(counts.into_iter(), growth)?;
        // Nothing of the table is ever given back, so every reservation continues the last one.
        let more_slots = (world.slot_count() as u32).saturating_sub(self.instance_count);
        room.slots = self.instances.alloc(more_slots, growth)?;
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
                && self.residency.get(slot_of(tree)).key != Some(tree)
            {
                changes.trees.extend([slot_of(tree)]);
            }
        }
        changes.trees.sort();
    }

    /// The number of parts of the instance in a slot: as many as its tree has records, once the
    /// states in `placed` replace the present ones. 0 without an instance.
    fn part_count(&self, slot: u32, world: &LightWorld, placed: &BTreeMap<u32, TreeState>) -> u32 {
        let tree = world.instance_at(slot).and_then(|key| world.instance_tree(key));
        tree.map_or(0, |tree| self.state_after(slot_of(tree), placed).records.len() as u32)
    }

    /// The state of a tree once those in `placed` replace the present ones.
    fn state_after<'a>(&'a self, slot: u32, placed: &'a BTreeMap<u32, TreeState>) -> &'a TreeState {
        placed.get(&slot).unwrap_or_else(|| self.residency.get(slot))
    }

    /// Counts the runs of records that will be written, and decides which pools take them from staged
    /// records.
    fn find_runs(&self, world: &LightWorld, changes: &PendingChanges, room: &mut Room) {
        let [mut node_count, mut light_count, mut tree_count, mut instance_count] =
            [RunCount::default(); scatter::MAX_TARGETS];
        for (write, [nodes, lights]) in &room.trees.writes {
            let runs = [&room.trees.runs[nodes.clone()], &room.trees.runs[lights.clone()]];
            runs[0].iter().for_each(|run| node_count.add(run));
            runs[1].iter().for_each(|run| light_count.add(run));
            let Some(key) = world.tree_at(write.slot) else { continue };
            let state = self.state_after(write.slot, &room.placed);
            let written = written_records(write, state.division, world.sections(key), state.records.len(), runs);
            written.for_each(|run| tree_count.add(&run));
        }
        room.instances = changes.records();
        add_runs(&mut room.instance_runs, room.instances.as_slice().iter().copied(), 0);
        room.instance_runs.iter().for_each(|run| instance_count.add(run));
        let staged = [
            self.nodes.staged_bytes(&node_count),
            self.lights.staged_bytes(&light_count),
            self.trees.staged_bytes(&tree_count),
            self.instances.staged_bytes(&instance_count),
        ];
        room.run_counts = [node_count, light_count, tree_count, instance_count];
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
        self.lists.keep(room.trees, room.instance_runs);
        for (slot, state) in room.placed {
            let former = self.residency.get(slot).clone();
            self.release_others(&state, &former);
        }
        let incoming = self.residency.incoming.clone();
        self.release_incoming(room.incoming, incoming.as_ref(), None);
        self.parts.release(room.parts);
        self.instances.free(room.slots);
        room.directionals.into_iter().for_each(|range| self.lights.free(range));
        self.nodes.undo();
        self.lights.undo();
        self.instances.undo();
        self.trees.undo();
        self.parts.pool().undo();
        self.top.undo();
        if let Some(restarted) = room.restarted {
            self.nodes.restore(restarted.nodes);
            self.lights.restore(restarted.lights);
            self.residency = restarted.residency;
            self.directionals = restarted.directionals;
        }
    }

    /// Frees the ranges of one state of a tree that another state of it does not have, and that are
    /// not those of a tree that is sent in pieces.
    pub(super) fn release_others(&mut self, state: &TreeState, kept: &TreeState) {
        let incoming = self.residency.incoming.clone();
        let is_incoming = |nodes: &Range<u32>, of: fn(&Incoming) -> &Range<u32>| {
            incoming.as_ref().is_some_and(|incoming| of(incoming) == nodes)
        };
        if state.nodes != kept.nodes && !is_incoming(&state.nodes, |incoming| &incoming.nodes) {
            self.nodes.free(state.nodes.clone());
        }
        if state.lights != kept.lights && !is_incoming(&state.lights, |incoming| &incoming.lights) {
            self.lights.free(state.lights.clone());
        }
        if state.records != kept.records {
            self.trees.free(state.records.clone());
        }
    }

    /// Frees the ranges of a tree that is sent in pieces, but for those of another one and those that
    /// shaders see.
    pub(super) fn release_incoming(
        &mut self,
        incoming: Option<Incoming>,
        kept: Option<&Incoming>,
        seen: Option<&TreeState>,
    ) {
        let Some(incoming) = incoming else { return };
        let is_kept = |range: &Range<u32>, of: [Option<&Range<u32>>; 2]| of.contains(&Some(range));
        if !is_kept(&incoming.nodes, [kept.map(|kept| &kept.nodes), seen.map(|seen| &seen.nodes)]) {
            self.nodes.free(incoming.nodes);
        }
        if !is_kept(&incoming.lights, [kept.map(|kept| &kept.lights), seen.map(|seen| &seen.lights)]) {
            self.lights.free(incoming.lights);
        }
    }
}

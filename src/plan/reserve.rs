//! Finds out which buffers a frame needs, before anything is written.

use std::collections::BTreeMap;
use std::fmt;

use super::LightPlanner;
use super::buffers::NewBuffer;
use super::changes::FrameChanges;
use super::error::PlanError;
use super::layout::{ParamsRecord, PartRecord, TreeRecord};
use super::opened::Opened;
use super::pool::Growth;
use super::residency::TreeState;
use super::room::{RecordRuns, ReusedLists, Room, TreeRoom};
use super::runs::add_runs;
use super::scatter::{self, RunCount};
use super::top::MapQuads;
use super::tree_writes::written_records;
use crate::effects::Effects;
use crate::instance::portal::PORTAL_QUADS;
use crate::keys::slot_of;
use crate::profile::stored_quads;
use crate::span::span;
use crate::world::LightWorld;

/// Room for profiles grows by so many quads: 64 KiB.
const PROFILE_QUADS: u32 = 1 << 12;

/// The room that the changes of a world need on the GPU. Make [`Reservation::new_buffers`], then
/// call [`Reservation::plan`].
///
/// Dropped without that, it changes nothing, and the next reservation has its changes too.
pub struct Reservation<'a> {
    pub(super) planner: &'a mut LightPlanner,
    pub(super) world: &'a LightWorld,
    pub(super) changes: FrameChanges,
    pub(super) room: Room,
    /// The room was taken into use, so that there is nothing to undo.
    pub(super) is_used: bool,
}

/// Which pools had too little room for a frame.
#[derive(Clone, Copy, Debug)]
enum Shortage {
    /// Those of nodes, of lights and of the records of trees.
    Trees,
    /// Those whose sizes follow the number of parts.
    Parts,
    /// Those that no other order makes room in.
    Others,
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
        }
    }
}

impl LightPlanner {
    /// Finds out which buffers the GPU needs to follow `world` from [`LightPlanner::revision`] on,
    /// however long ago that was. Changes nothing that shaders read. O(what changed).
    ///
    /// # Errors
    /// [`PlanError::Full`] if a buffer would outgrow [`PlanLimits`](super::PlanLimits). The next call
    /// starts from the same revision, and succeeds once the world holds less.
    pub fn reserve<'a>(&'a mut self, world: &'a LightWorld) -> Result<Reservation<'a>, PlanError> {
        self.reserve_as(world, Growth::Double)
    }

    /// As [`LightPlanner::reserve`], with buffers no larger than needed. An engine that has no
    /// memory for the buffers of `reserve` drops that reservation, and may try this.
    ///
    /// # Errors
    /// As [`LightPlanner::reserve`].
    pub fn reserve_exactly<'a>(&'a mut self, world: &'a LightWorld) -> Result<Reservation<'a>, PlanError> {
        self.reserve_as(world, Growth::Exact)
    }

    /// Reserves with buffers that grow so.
    pub(crate) fn reserve_as<'a>(
        &'a mut self,
        world: &'a LightWorld,
        growth: Growth,
    ) -> Result<Reservation<'a>, PlanError> {
        span!("reserve");
        if self.is_lost {
            self.trees.residency.lose();
            self.instances.parts.lose_records();
            self.top.lose();
            self.sources.lose();
        }
        let mut changes = match self.is_lost {
            true => FrameChanges::everything(world),
            false => FrameChanges::since(self.revision, world),
        };
        let has_params = self.uniforms.params_buffer.is_some() && self.uniforms.params == self.params_of(world);
        let is_idle = changes.is_empty() && has_params && !self.has_work();
        self.trees.divide_memory(world);
        // As it is before anything grows.
        let present = self.present();
        let mut room = self.new_room(growth);
        room.is_idle = is_idle;
        if !is_idle {
            room.trees.formerly_opened = self.decide_openings(world, &mut changes);
        }
        let mut result = if is_idle { Ok(()) } else { self.make_room(world, &mut changes, &mut room) };
        if let Err((shortage @ (Shortage::Trees | Shortage::Parts), _)) = result {
            let formerly_opened = room.trees.formerly_opened.take();
            self.undo(std::mem::take(&mut room));
            let all = FrameChanges::everything(world);
            room = self.new_room(growth);
            room.trees.formerly_opened = formerly_opened;
            // Without gaps they may fit.
            room.restarted_parts = Some(self.instances.parts.restart());
            changes = match shortage {
                Shortage::Parts => FrameChanges { trees: changes.trees, ..all },
                // With stand-ins in place of the less useful trees as well.
                _ => {
                    room.trees.restarted = Some(self.trees.restart(world));
                    all
                }
            };
            result = self.make_room(world, &mut changes, &mut room);
        }
        if let Err((_, error)) = result {
            self.undo(room);
            return Err(error);
        }
        let limits = (self.trees.limits.largest_buffer, growth);
        room.copies = self.previous.reserve(present, limits, (&mut self.buffers.ids, &mut room.new_buffers));
        Ok(Reservation { planner: self, world, changes, room, is_used: false })
    }

    /// Decides which trees are opened for shaders, and adds those to the changes that are not as decided. Returns
    /// the former decision if it is another one.
    fn decide_openings(&mut self, world: &LightWorld, changes: &mut FrameChanges) -> Option<Opened> {
        let limit = self.trees.limits.largest_buffer;
        let records = size_of::<TreeRecord>().max(size_of::<PartRecord>()) as u64;
        let room = (limit / records).min(self.top.most_parts(map_sizes(world)).into());
        let decided = self.trees.opened.decided(world, room)?;
        let former = std::mem::replace(&mut self.trees.opened, decided);
        let slots: Vec<u32> = self.trees.slots_to_reopen(world).collect();
        changes.trees.extend(slots);
        changes.trees.sort();
        Some(former)
    }

    /// Whether trees wait that this frame may send.
    fn has_work(&self) -> bool {
        let may_send = self.trees.limits.frame_bytes != Some(0);
        let has_waiting = self.trees.residency.waiting_count() > 0 || self.trees.residency.incoming.is_some();
        has_waiting && may_send || self.trees.is_resized || self.trees.may_join_gaps()
    }

    fn new_room(&mut self, growth: Growth) -> Room {
        let ReusedLists { trees, instance_runs } = std::mem::take(&mut self.lists);
        Room {
            trees: TreeRoom { growth, is_lost: self.is_lost, writes: trees, ..TreeRoom::default() },
            runs: RecordRuns { instances: instance_runs, ..RecordRuns::default() },
            ..Room::default()
        }
    }

    /// Reserves room for everything that grew: the first three steps of each
    /// [`Pool`](super::pool::Pool). To be undone if it fails.
    fn make_room(
        &mut self,
        world: &LightWorld,
        changes: &mut FrameChanges,
        room: &mut Room,
    ) -> Result<(), (Shortage, PlanError)> {
        self.instances.pool.begin().map_err(|error| (Shortage::Others, error))?;
        self.instances.parts.pool().begin().map_err(|error| (Shortage::Parts, error))?;
        self.make_room_of_trees(world, changes, room).map_err(|error| (Shortage::Trees, error))?;
        self.trees.add_placed_instances(world, &room.trees, changes);
        self.make_room_of_parts(world, changes, room).map_err(|error| (Shortage::Parts, error))?;
        let others = self.make_room_of_others(world, changes, room);
        others.map_err(|error| (Shortage::Others, error))?;
        self.find_runs(world, changes, room);
        self.name_buffers(room);
        Ok(())
    }

    fn make_room_of_trees(
        &mut self,
        world: &LightWorld,
        changes: &FrameChanges,
        room: &mut Room,
    ) -> Result<(), PlanError> {
        self.trees.nodes.begin()?;
        self.trees.lights.begin()?;
        self.trees.records.begin()?;
        self.trees.place_trees(world, changes, &mut room.trees)?;
        let directionals = world.directional_count() as u32;
        if changes.directionals && directionals as usize != self.trees.directionals.len() {
            room.directionals = Some(self.trees.lights.alloc(directionals, room.trees.growth)?);
        }
        Ok(())
    }

    fn make_room_of_parts(
        &mut self,
        world: &LightWorld,
        changes: &FrameChanges,
        room: &mut Room,
    ) -> Result<(), PlanError> {
        let growth = room.trees.growth;
        let slots = changes.parts.as_slice().iter();
        let counts: Vec<_> = slots.map(|slot| (*slot, self.part_count(*slot, world, &room.trees.placed))).collect();
        room.parts = self.instances.parts.reserve(counts.into_iter(), growth)?;
        let parts = self.instances.parts.count();
        let maps = map_sizes(world);
        let nodes = self.top.fitting(world.partition(), parts, maps).len() as u32;
        self.top.reserve([parts, nodes], maps, growth, (&mut self.buffers.ids, &mut room.new_buffers))
    }

    fn make_room_of_others(
        &mut self,
        world: &LightWorld,
        changes: &mut FrameChanges,
        room: &mut Room,
    ) -> Result<(), PlanError> {
        let growth = room.trees.growth;
        // Nothing of the table is ever given back, so every reservation continues the last one.
        let more_slots = self.slots_of(world).saturating_sub(self.instances.count);
        room.slots = self.instances.pool.alloc(more_slots, growth)?;
        // Shaders read no slots beyond the table.
        changes.instances.cut_to(self.instances.count.max(room.slots.end));
        self.sources.reserve(
            (world, changes),
            (&|slot| self.trees.state_after(slot, &room.trees.placed), &room.trees.placed),
            growth,
            &mut room.sources,
        )
    }

    /// The length of the table of instances: all slots of the world, or those up to the last one in use where the
    /// table has no room for all. O(free slots at the end) then.
    fn slots_of(&self, world: &LightWorld) -> u32 {
        let all = world.slot_count() as u32;
        let last = || (0..all).rev().find(|slot| world.instance_at(*slot).is_some());
        if u64::from(all) > self.instances.pool.limit() { last().map_or(0, |slot| slot + 1) } else { all }
    }

    /// The number of parts of the instance in a slot: as many as its tree has records, once the
    /// states in `placed` replace the present ones. 0 without an instance.
    fn part_count(&self, slot: u32, world: &LightWorld, placed: &BTreeMap<u32, TreeState>) -> u32 {
        let tree = world.instance_at(slot).and_then(|key| world.instance_tree(key));
        tree.map_or(0, |tree| self.trees.state_after(slot_of(tree), placed).records.len() as u32)
    }

    /// Counts the runs of records that will be written, and decides which pools take them from staged
    /// records.
    fn find_runs(&self, world: &LightWorld, changes: &FrameChanges, room: &mut Room) {
        let [mut node_count, mut light_count, mut tree_count, mut instance_count] =
            [RunCount::default(); scatter::MAX_TARGETS];
        for (write, [nodes, lights]) in &room.trees.writes.writes {
            let runs = [&room.trees.writes.runs[nodes.clone()], &room.trees.writes.runs[lights.clone()]];
            runs[0].iter().for_each(|run| node_count.add(run));
            runs[1].iter().for_each(|run| light_count.add(run));
            let Some(entry) = world.tree_at(write.slot).and_then(|key| world.tree_entry(key)) else { continue };
            let state = self.trees.state_after(write.slot, &room.trees.placed);
            let written = written_records(write, state.openings(entry), state.records.len(), runs[0]);
            written.for_each(|run| tree_count.add(&run));
        }
        add_runs(&mut room.runs.instances, changes.instances.as_slice().iter().copied(), 0);
        room.runs.instances.iter().for_each(|run| instance_count.add(run));
        let staged = [
            self.trees.nodes.staged_bytes(&node_count),
            self.trees.lights.staged_bytes(&light_count),
            self.trees.records.staged_bytes(&tree_count),
            self.instances.pool.staged_bytes(&instance_count),
        ];
        room.runs.counts = [node_count, light_count, tree_count, instance_count];
        let bytes: u64 = staged.iter().sum();
        if bytes <= self.trees.limits.largest_buffer {
            room.runs.is_scattered = staged.map(|bytes| bytes > 0);
            room.runs.staged_bytes = bytes;
        }
    }

    /// Gives numbers to the new buffers.
    fn name_buffers(&mut self, room: &mut Room) {
        let ids = &mut self.buffers.ids;
        let pools = [
            self.trees.nodes.end(ids),
            self.trees.lights.end(ids),
            self.instances.pool.end(ids),
            self.trees.records.end(ids),
            self.instances.parts.pool().end(ids),
        ];
        room.new_buffers.extend(pools.into_iter().flatten());
        self.sources.end(&room.sources, ids, &mut room.new_buffers);
        let mut add = |buffer: NewBuffer| {
            room.new_buffers.push(buffer);
            buffer.id
        };
        if room.runs.staged_bytes > 0 && self.uniforms.scatter.is_none() {
            room.uniforms.scatter = Some(add(ids.uniform("scatter", scatter::UNIFORM_BYTES)));
        }
        let staging = self.uniforms.staging.map_or(0, |(_, bytes)| bytes);
        if room.runs.staged_bytes > staging {
            let largest = self.trees.limits.largest_buffer & !3;
            let bytes = room.runs.staged_bytes.max(2 * staging).min(largest);
            room.uniforms.staging = Some((add(ids.storage("staged records", bytes)), bytes));
        }
        // The former parameters belong to the former buffers.
        let is_replaced = self.top.is_replaced()
            || self.trees.nodes.is_replaced()
            || self.instances.pool.is_replaced()
            || self.trees.lights.is_replaced();
        if is_replaced {
            room.uniforms.params = Some(add(ids.uniform("sampling parameters", size_of::<ParamsRecord>() as u64)));
        }
    }

    /// Takes back what was reserved.
    fn undo(&mut self, room: Room) {
        self.lists.keep(room.trees.writes, room.runs.instances);
        for (slot, state) in room.trees.placed {
            let former = self.trees.residency.get(slot).clone();
            self.trees.release_others(&state, &former);
        }
        let incoming = self.trees.residency.incoming.clone();
        self.trees.release_incoming(room.trees.incoming, incoming.as_ref(), None);
        self.instances.parts.release(room.parts);
        self.instances.pool.free(room.slots);
        room.directionals.into_iter().for_each(|range| self.trees.lights.free(range));
        self.trees.nodes.undo();
        self.trees.lights.undo();
        self.instances.pool.undo();
        self.trees.records.undo();
        self.instances.parts.pool().undo();
        self.top.undo();
        self.sources.undo(room.sources);
        if let Some(restarted) = room.restarted_parts {
            self.instances.parts.restore(restarted);
        }
        if let Some(restarted) = room.trees.restarted {
            self.trees.restore(*restarted);
        }
        if let Some(opened) = room.trees.formerly_opened {
            self.trees.opened = opened;
        }
    }
}

/// Whether there are masks, and the quads of maps, beside the top level.
pub(super) fn map_sizes(world: &LightWorld) -> (bool, MapQuads) {
    let effects = world.effects();
    let quads = MapQuads {
        // Shaders that know portals read their number wherever there is a sky.
        portals: match effects.contains(Effects::PORTALS) {
            true => PORTAL_QUADS,
            false => u32::from(world.sky().is_some()),
        },
        profiles: match effects.contains(Effects::PROFILES) {
            // In steps, so that not each new profile takes another buffer.
            true => stored_quads().next_multiple_of(PROFILE_QUADS),
            false => 0,
        },
        sky: world.sky().map_or(0, |(_, sky)| sky.stored_quads()),
    };
    (effects.contains(Effects::MASKS), quads)
}

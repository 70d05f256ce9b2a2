//! One frame: finds room for what changed, and writes it.

use std::fmt;

use super::LightPlanner;
use super::buffers::NewBuffer;
use super::changes::{FrameChanges, sort};
use super::draft::{Draft, Growth, Shortage};
use super::error::PlanError;
use super::frame::FramePlan;
use super::held::Held;
use super::layout::{PartRecord, TreeRecord};
use super::room::{Frame, TreeFrame};
use super::top::MapQuads;
use crate::effects::Effects;
use crate::instance::portal::PORTAL_QUADS;
use crate::keys::slot_of;
use crate::profile::stored_quads;
use crate::span::span;
use crate::world::LightWorld;

/// Room for profiles grows by so many quads: 64 KiB.
const PROFILE_QUADS: u32 = 1 << 12;

/// A plan whose buffers are still to be made. Make [`Reservation::new_buffers`], then call [`Reservation::plan`].
///
/// Dropped without that, it changes nothing, and the next reservation has its changes too.
pub struct Reservation<'a> {
    planner: &'a mut LightPlanner,
    /// What the device holds after the plan.
    next: Held,
    plan: FramePlan,
}

impl<'a> Reservation<'a> {
    pub(super) fn new(planner: &'a mut LightPlanner, mut next: Held, draft: Draft) -> Self {
        let mut plan = draft.plan;
        // Numbers of buffers are never used again, whatever becomes of this plan.
        planner.held.ids = draft.ids;
        next.ids = draft.ids;
        next.number += 1;
        plan.number = next.number;
        next.buffers.change(&plan.new_buffers, &plan.freed);
        Self { planner, next, plan }
    }

    /// The buffers that the plan needs. Buffers of former plans stay in use.
    pub fn new_buffers(&self) -> &[NewBuffer] {
        &self.plan.new_buffers
    }

    /// Returns the plan, which the planner takes as played from now on. The buffers that were reserved must exist.
    pub fn plan(self) -> FramePlan {
        self.planner.held = self.next;
        self.plan
    }
}

impl fmt::Debug for Reservation<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Reservation").field("new_buffers", &self.new_buffers()).finish_non_exhaustive()
    }
}

/// What is placed anew, without gaps, because it did not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Anew {
    Nothing,
    Parts,
    /// Parts and trees. All trees that may start as stand-ins do.
    Trees,
}

impl LightPlanner {
    /// Plans what the GPU needs to follow `world` from [`LightPlanner::revision`] on, however long ago that was.
    /// Changes nothing until the plan is taken. Copies what is sent: O(what changed). A plan without changes has no
    /// commands.
    ///
    /// # Errors
    /// [`PlanError::Full`] if a buffer would outgrow [`PlanLimits`](super::PlanLimits). The next call
    /// starts from the same revision, and succeeds once the world holds less.
    pub fn reserve(&mut self, world: &LightWorld) -> Result<Reservation<'_>, PlanError> {
        self.reserve_as(world, Growth::Double)
    }

    /// As [`LightPlanner::reserve`], with buffers no larger than needed. An engine that has no
    /// memory for the buffers of `reserve` drops that reservation, and may try this.
    ///
    /// # Errors
    /// As [`LightPlanner::reserve`].
    pub fn reserve_exactly(&mut self, world: &LightWorld) -> Result<Reservation<'_>, PlanError> {
        self.reserve_as(world, Growth::Exact)
    }

    pub(crate) fn reserve_as(&mut self, world: &LightWorld, growth: Growth) -> Result<Reservation<'_>, PlanError> {
        span!("reserve");
        let mut anew = Anew::Nothing;
        loop {
            let (mut next, mut draft) = (self.held.clone(), Draft::new(self.held.ids, growth));
            let result = next.follow(world, anew, &mut draft);
            self.held.ids = draft.ids;
            anew = match (result, anew) {
                (Ok(()), _) => return Ok(Reservation::new(self, next, draft)),
                (Err(Shortage::Parts(_)), Anew::Nothing) => Anew::Parts,
                (Err(Shortage::Trees(_)), Anew::Nothing | Anew::Parts) => Anew::Trees,
                (Err(Shortage::Trees(error) | Shortage::Parts(error) | Shortage::Others(error)), _) => {
                    return Err(error);
                }
            };
        }
    }
}

impl Held {
    /// Follows a world, and plans what the device has to do for it.
    fn follow(&mut self, world: &LightWorld, anew: Anew, draft: &mut Draft) -> Result<(), Shortage> {
        if self.is_lost {
            self.lose();
        }
        let mut changes = FrameChanges::since(self.revision, world);
        if self.is_lost || anew != Anew::Nothing {
            let all = FrameChanges::everything(world);
            let is_all_trees = self.is_lost || anew == Anew::Trees;
            changes = if is_all_trees { all } else { FrameChanges { trees: changes.trees, ..all } };
        }
        let has_params = self.uniforms.params_buffer.is_some() && self.uniforms.params == self.params_of(world);
        let is_idle = changes.is_empty() && has_params && !self.has_work();
        self.trees.divide_memory(world);
        self.previous.copy(self.present(), self.uniforms.params, self.trees.limits.largest_buffer, draft);
        if is_idle {
            self.rest(world, draft);
        } else {
            if anew == Anew::Trees {
                self.trees.restart(world);
            }
            if anew != Anew::Nothing {
                self.instances.parts.restart();
            }
            let before = self.bindings();
            self.decide_openings(world, &mut changes);
            let frame = self.make_room(world, changes, anew == Anew::Trees, draft)?;
            self.write(frame, before, draft);
        }
        self.trees.is_resized = false;
        self.revision = world.revision();
        // No shader depends on whether lights move.
        self.effects = world.effects() - Effects::MOVING;
        Ok(())
    }

    /// The device may lack what was written.
    fn lose(&mut self) {
        self.trees.residency.lose();
        self.instances.parts.lose_records();
        self.top.lose();
        self.sources.lose();
    }

    /// Plans a frame in which nothing has changed that shaders read.
    fn rest(&mut self, world: &LightWorld, draft: &mut Draft) {
        let FramePlan { upload, top, report, .. } = &mut draft.plan;
        let is_refit = self.sources.is_active();
        self.top.is_due |= is_refit;
        if self.top.is_due {
            self.finish_top(top);
        }
        self.cuts.follow(upload, world.origin(), !top.is_empty(), false);
        *report = self.report_of(upload);
        self.previous.changed([false, is_refit]);
    }

    /// Decides which trees are opened for shaders, and adds those to the changes that are not as decided.
    fn decide_openings(&mut self, world: &LightWorld, changes: &mut FrameChanges) {
        let limit = self.trees.limits.largest_buffer;
        let records = size_of::<TreeRecord>().max(size_of::<PartRecord>()) as u64;
        let room = (limit / records).min(self.top.most_parts(MapQuads::of(world)).into());
        if let Some(decided) = self.trees.opened.decided(world, room) {
            self.trees.opened = decided;
            let slots: Vec<u32> = self.trees.slots_to_reopen(world).collect();
            changes.trees.extend(slots);
            sort(&mut changes.trees);
        }
    }

    /// Whether trees wait that this frame may send.
    fn has_work(&self) -> bool {
        let may_send = self.trees.limits.frame_bytes != Some(0);
        self.trees.residency.waiting_count() > 0 && may_send || self.trees.is_resized || self.trees.may_join_gaps()
    }

    /// Finds room for everything that grew, and what is written.
    fn make_room<'a>(
        &mut self,
        world: &'a LightWorld,
        changes: FrameChanges,
        is_anew: bool,
        draft: &mut Draft,
    ) -> Result<Frame<'a>, Shortage> {
        // No bytes while all trees start anew as stand-ins, which leaves as much room as possible.
        let left = if is_anew { 0 } else { self.trees.limits.frame_bytes.unwrap_or(u64::MAX) };
        let mut frame = Frame { world, changes, trees: TreeFrame { left, ..TreeFrame::default() } };
        self.make_room_of_trees(&mut frame).map_err(Shortage::Trees)?;
        self.trees.add_placed_instances(world, &frame.trees, &mut frame.changes);
        self.make_room_of_parts(&frame, draft).map_err(Shortage::Parts)?;
        self.make_room_of_others(&mut frame, draft).map_err(Shortage::Others)?;
        self.settle(draft);
        Ok(frame)
    }

    fn make_room_of_trees(&mut self, frame: &mut Frame<'_>) -> Result<(), PlanError> {
        self.trees.nodes.keep_limit()?;
        self.trees.lights.keep_limit()?;
        self.trees.place_trees(frame.world, &frame.changes, &mut frame.trees)?;
        let directionals = frame.world.directionals().len() as u32;
        if frame.changes.directionals && directionals as usize != self.trees.directionals.len() {
            self.trees.lights.free(std::mem::take(&mut self.trees.directionals));
            self.trees.directionals = self.trees.lights.alloc(directionals)?;
        }
        Ok(())
    }

    fn make_room_of_parts(&mut self, frame: &Frame<'_>, draft: &mut Draft) -> Result<(), PlanError> {
        for slot in &frame.changes.parts {
            // As many as the tree has records; none without an instance.
            let tree = frame.world.instance_at(*slot).and_then(|key| frame.world.instance(key).map(|i| i.tree));
            let count = tree.map_or(0, |tree| self.trees.residency.get(slot_of(tree)).records.len() as u32);
            self.instances.parts.place(*slot, count)?;
        }
        self.instances.parts.free_former();
        let (parts, maps) = (self.instances.parts.count(), MapQuads::of(frame.world));
        let nodes = self.top.fitting(frame.world.partition(), parts, maps).len() as u32;
        self.top.reserve(parts, nodes, maps, draft)
    }

    fn make_room_of_others(&mut self, frame: &mut Frame<'_>, draft: &mut Draft) -> Result<(), PlanError> {
        // Nothing of the table is ever given back, so every range continues the last one.
        let more_slots = self.slots_of(frame.world).saturating_sub(self.instances.count);
        self.instances.count = self.instances.count.max(self.instances.pool.alloc(more_slots)?.end);
        // Shaders read no slots beyond the table.
        let end = frame.changes.instances.partition_point(|slot| *slot < self.instances.count);
        frame.changes.instances.truncate(end);
        self.sources.place(frame, &self.trees.residency, draft)
    }

    /// The length of the table of instances: all slots of the world, or those up to the last one in use where the
    /// table has no room for all. O(free slots at the end) then.
    fn slots_of(&self, world: &LightWorld) -> u32 {
        let all = world.slot_count() as u32;
        let last = || (0..all).rev().find(|slot| world.instance_at(*slot).is_some());
        if u64::from(all) > self.instances.pool.limit() { last().map_or(0, |slot| slot + 1) } else { all }
    }

    /// Makes the buffers of all pools large enough.
    fn settle(&mut self, draft: &mut Draft) {
        self.trees.nodes.settle(draft);
        self.trees.lights.settle(draft);
        self.trees.records.settle(draft);
        self.instances.pool.settle(draft);
        self.instances.parts.settle(draft);
    }
}

impl MapQuads {
    /// The maps beside the top level of a world.
    pub(super) fn of(world: &LightWorld) -> Self {
        let effects = world.effects();
        Self {
            has_masks: effects.contains(Effects::MASKS),
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
        }
    }
}

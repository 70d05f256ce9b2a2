//! Decides what of each tree a frame sends: the whole tree, what changed, a piece, or stand-ins.
//!
//! What changed in a tree that shaders see whole is sent at once, whatever its size. New trees and
//! new versions of trees then share the bytes of a frame, the most useful first. Until a tree has been
//! sent, shaders see its older version, or else its stand-ins.

use std::ops::Range;

use super::changes::{FrameChanges, sort};
use super::error::PlanError;
use super::layout::{LightRecord, TreeRecord};
use super::node_record::{NodeRecord, stored_nodes};
use super::pool::Pool;
use super::residency::{Form, Incoming, NOT_WEIGHED, TreeState, has_room, with_growth};
use super::room::TreeFrame;
use super::runs::runs;
use super::stand_in::{may_stand_in, stand_ins};
use super::tree_store::TreeStore;
use super::tree_writes::{Source, TreeWrite};
use crate::keys::{TreeKey, slot_of};
use crate::tree::LightTree;
use crate::world::{LightWorld, TreeChanges, TreeEntry};

/// Nodes that did not change are sent too if at most this many lie between two that did. That saves
/// a write.
const NODE_GAP: u32 = 2;
/// The same for lights.
const LIGHT_GAP: u32 = 8;

/// The number of trees whose usefulness a frame computes again while trees wait.
const WEIGHED_PER_FRAME: u32 = 64;

/// A tree is evicted only for one that is more useful by this factor, so that two trees do not
/// displace each other in turn.
const MIN_GAIN: f32 = 1.25;

/// The most trees that are evicted for one.
const MAX_LOOKED_AT: usize = 4096;

/// The most of them in one frame.
const MAX_FALLBACKS: usize = 16;

/// The most trees that are looked at to find one that can move to a gap.
const MAX_MOVES: usize = 64;

/// Trees move to gaps once more than one part in this many of a pool, up to its last tree, is gaps.
const MAX_GAPS: u64 = 8;

/// These moves may take one part in this many of the bytes of a frame.
const MOVED_SHARE: u64 = 4;

/// Bytes that a frame moves to make room for a tree if nothing bounds what it sends.
const MOVED_BYTES: u64 = 256 * 1024;

/// A tree that changes as a whole while it is sent in pieces is started again at most this many
/// times. Then it is sent at once.
const MAX_RESTARTS: u32 = 2;

/// The most waiting trees that a frame of limited bytes looks at.
const MAX_BROUGHT: usize = 4096;

/// The most trees for which a frame finds no room before it gives up. They are tried again only once
/// something has changed, so that the next frame looks at others.
const MAX_REFUSALS: usize = 8;

/// The most of them that a frame tries again.
const MAX_RETRIES: usize = 4;

/// A tree of the world, and the key under which shaders know it.
#[derive(Clone, Copy)]
struct Subject<'a> {
    slot: u32,
    key: TreeKey,
    entry: &'a TreeEntry,
    /// How many openings the tree has for shaders.
    openings: usize,
}

impl<'a> Subject<'a> {
    fn tree(&self) -> &'a LightTree {
        &self.entry.tree
    }

    fn is_opened(&self) -> bool {
        self.openings > 0
    }

    /// A write of runs of the tree as shaders are to see it, to these places in the pools.
    fn write(&self, source: Source, bases: [u32; 2], has_new_records: bool, runs: [Vec<Range<u32>>; 2]) -> TreeWrite {
        TreeWrite { slot: self.slot, source, is_opened: self.is_opened(), bases, has_new_records, runs }
    }

    fn counts(&self) -> [usize; 2] {
        [stored_nodes(self.tree()).len(), self.tree().lights().len()]
    }

    /// The error that stand-ins of the tree make, per node and light of the tree, as the bits of a
    /// non-negative f32, which compare like the number. [`NOT_WEIGHED`] for a tree that is always
    /// whole.
    fn usefulness(&self, world: &LightWorld) -> u32 {
        if !may_stand_in(self.tree()) {
            return NOT_WEIGHED;
        }
        let records: usize = self.counts().into_iter().sum();
        let usefulness = world.error_of_stand_ins(self.key) / records as f32;
        if usefulness > 0.0 { usefulness.to_bits() } else { 0 }
    }

    /// The runs of nodes and lights that differ from those of the tree that was written at a revision with so
    /// many openings. If the tree changed as a whole, all of them and `true`.
    fn changes_since(&self, revision: u64, openings: usize) -> ([Vec<Range<u32>>; 2], bool) {
        let Some(TreeChanges { mut nodes, mut lights }) = self.entry.log.since(revision) else {
            return (self.counts().map(all), true);
        };
        if openings != self.openings {
            // The log has what the world has opened, and not what the planner has.
            for opening in &self.entry.openings {
                match opening.light() {
                    Some(light) => lights.push(light),
                    None => nodes.push(opening.child_bits),
                }
            }
            for changed in [&mut nodes, &mut lights] {
                changed.sort_unstable();
                changed.dedup();
            }
        }
        ([runs(nodes, NODE_GAP), runs(lights, LIGHT_GAP)], false)
    }
}

/// One run of all records, or none.
fn all(count: usize) -> Vec<Range<u32>> {
    std::iter::once(0..count as u32).filter(|run| !run.is_empty()).collect()
}

/// Whether the ranges of a tree have room for its present nodes and lights, but not much more.
fn has_room_for(state: &TreeState, subject: &Subject) -> bool {
    let [nodes, lights] = subject.counts();
    has_room(&state.nodes, nodes) && has_room(&state.lights, lights)
}

fn length(runs: &[Range<u32>]) -> usize {
    runs.iter().map(|run| run.len()).sum()
}

impl TreeStore {
    /// The tree of a slot; `None` if it has none.
    fn subject<'a>(&self, world: &'a LightWorld, slot: u32) -> Option<Subject<'a>> {
        let key = world.tree_at(slot)?;
        let entry = world.tree_entry(key)?;
        Some(Subject { slot, key, entry, openings: self.opened.openings(entry) })
    }

    /// The slots of the trees that shaders see whole, and that are to be opened or closed for them.
    pub fn slots_to_reopen(&self, world: &LightWorld) -> impl Iterator<Item = u32> {
        let is_due = |slot: &u32| {
            self.subject(world, *slot).is_some_and(|subject| {
                let state = self.residency.get(*slot);
                state.form == Form::Whole && state.key == Some(subject.key) && state.openings != subject.openings
            })
        };
        (0..world.tree_slot_count()).filter(is_due)
    }

    /// Reserves ranges for trees whose size has changed and for trees that waited, and lists what
    /// the frame writes of all trees.
    pub fn place_trees(
        &mut self,
        world: &LightWorld,
        changes: &FrameChanges,
        frame: &mut TreeFrame,
    ) -> Result<(), PlanError> {
        let changed = &changes.trees;
        for slot in changed {
            self.follow(world, *slot, frame)?;
        }
        self.go_on(world, frame)?;
        if frame.left > 0 && self.residency.waiting_count() > 0 {
            self.stream(world, changed, frame)?;
        }
        if !changed.is_empty() {
            // The next frames may find room that this one has not found.
            self.residency.retry();
        }
        for slot in changed {
            let state = self.residency.get(*slot);
            if state.waits
                && !state.is_readable()
                && let Some(subject) = self.subject(world, *slot)
            {
                self.show_stand_ins(world, &subject, frame)?;
            }
        }
        if frame.left > 0 && self.may_join_gaps() {
            let bytes = self.limits.frame_bytes.map_or(0, |bytes| bytes.div_ceil(MOVED_SHARE));
            let has_moved = self.join_gaps(world, bytes, changed, frame)?;
            self.residency.is_packed |= !has_moved;
        }
        Ok(())
    }

    /// Whether so much of the pools is gaps that trees should move to them, unless the last search
    /// found none that can.
    pub fn may_join_gaps(&self) -> bool {
        let has_gaps = |end: u64, taken: u64| (end - taken) * MAX_GAPS > end;
        let sends = self.limits.frame_bytes.is_some_and(|bytes| bytes > 0);
        sends
            && !self.residency.is_packed
            && (has_gaps(self.nodes.used(), self.nodes.taken()) || has_gaps(self.lights.used(), self.lights.taken()))
    }

    fn bytes(&self, [nodes, lights]: [usize; 2]) -> u64 {
        (nodes * size_of::<NodeRecord>() + lights * size_of::<LightRecord>()) as u64
    }

    /// Sends what changed in the tree of a slot if shaders see it whole, and all of a small tree. Any other tree waits.
    fn follow(&mut self, world: &LightWorld, slot: u32, frame: &mut TreeFrame) -> Result<(), PlanError> {
        let Some(subject) = self.subject(world, slot) else {
            self.put(slot, TreeState::NONE, frame);
            return Ok(());
        };
        let is_small = !may_stand_in(subject.tree());
        let state = Some(self.residency.get(slot)).filter(|state| state.key == Some(subject.key)).cloned();
        let state = state.unwrap_or_else(|| TreeState::new(subject.key));
        if state.form == Form::Whole && has_room_for(&state, &subject) {
            let (runs, is_all) = subject.changes_since(state.revision, state.openings);
            // A lost device gets what it had.
            if !is_all || is_small || !state.is_readable() {
                return self.write_in_place(world, &subject, state, runs, frame);
            }
        }
        if is_small {
            let ranges = self.alloc(state.room_for(subject.counts()))?;
            let runs = subject.counts().map(all);
            return self.show_whole(world, &subject, state, (ranges, runs), frame);
        }
        let (bytes, usefulness) = (self.bytes(subject.counts()), subject.usefulness(world));
        self.put(slot, TreeState { waits: true, bytes, usefulness, ..state }, frame);
        Ok(())
    }

    /// Ranges for nodes and lights, both or neither.
    fn alloc(&mut self, [nodes, lights]: [u32; 2]) -> Result<[Range<u32>; 2], PlanError> {
        let nodes = self.nodes.alloc(nodes)?;
        match self.lights.alloc(lights) {
            Ok(lights) => Ok([nodes, lights]),
            Err(error) => {
                self.nodes.free(nodes);
                Err(error)
            }
        }
    }

    /// The same, if that leaves enough for what cannot do without.
    fn alloc_spare(&mut self, [nodes, lights]: [u32; 2]) -> Option<[Range<u32>; 2]> {
        let has_room = self.nodes.missing(nodes.into()) == 0 && self.lights.missing(lights.into()) == 0;
        if has_room { self.alloc([nodes, lights]).ok() } else { None }
    }

    /// Writes runs of a tree to the ranges where shaders see it.
    fn write_in_place(
        &mut self,
        world: &LightWorld,
        subject: &Subject,
        state: TreeState,
        runs: [Vec<Range<u32>>; 2],
        frame: &mut TreeFrame,
    ) -> Result<(), PlanError> {
        let bases = [state.nodes.start, state.lights.start];
        let count = TreeRecord::count(subject.openings) as usize;
        let has_new_records = state.waits || state.openings != subject.openings || state.records.len() != count;
        if has_new_records || state.replaced != subject.entry.births.replaced {
            self.set_state(world, subject, TreeState { waits: false, ..state }, subject.openings, frame)?;
        }
        frame.writes.push(subject.write(Source::Tree, bases, has_new_records, runs));
        Ok(())
    }

    /// Lets shaders see a tree in these ranges, of which these runs are still to be written.
    fn show_whole(
        &mut self,
        world: &LightWorld,
        subject: &Subject,
        state: TreeState,
        ([nodes, lights], runs): ([Range<u32>; 2], [Vec<Range<u32>>; 2]),
        frame: &mut TreeFrame,
    ) -> Result<(), PlanError> {
        let bases = [nodes.start, lights.start];
        let state = TreeState { form: Form::Whole, waits: false, nodes, lights, ..state };
        self.set_state(world, subject, state, subject.openings, frame)?;
        frame.writes.push(subject.write(Source::Tree, bases, true, runs));
        Ok(())
    }

    /// Lets shaders see stand-ins of the tree. Fails, and changes nothing, if there is no room for them.
    fn show_stand_ins(
        &mut self,
        world: &LightWorld,
        subject: &Subject,
        frame: &mut TreeFrame,
    ) -> Result<(), PlanError> {
        let state = self.residency.get(subject.slot).clone();
        let few = stand_ins(subject.tree());
        let counts = [stored_nodes(&few).len(), few.lights().len()];
        let is_same = state.form == Form::StandIns && [state.nodes.len(), state.lights.len()] == counts;
        let [nodes, lights] = match is_same {
            true => [state.nodes.clone(), state.lights.clone()],
            false => self.alloc(counts.map(|count| count as u32))?,
        };
        let (bases, bytes) = ([nodes.start, lights.start], self.bytes(subject.counts()));
        let ranges = [nodes.clone(), lights.clone()];
        let state = TreeState { form: Form::StandIns, waits: true, bytes, nodes, lights, ..state };
        if let Err(error) = self.set_state(world, subject, state, 0, frame) {
            let [nodes, lights] = ranges;
            if !is_same {
                self.nodes.free(nodes);
                self.lights.free(lights);
            }
            return Err(error);
        }
        frame.writes.push(subject.write(Source::StandIns(Box::new(few)), bases, true, counts.map(all)));
        Ok(())
    }

    /// Puts a state in place of the present one of a tree, and frees the ranges that only the latter has.
    fn put(&mut self, slot: u32, state: TreeState, frame: &mut TreeFrame) {
        let former = self.residency.replace(slot, state.clone());
        if former.nodes != state.nodes {
            self.nodes.free(former.nodes.clone());
        }
        if former.lights != state.lights {
            self.lights.free(former.lights.clone());
        }
        if former.records != state.records {
            self.records.free(former.records.clone());
        }
        frame.placed.entry(slot).or_insert(former);
    }

    /// Records the state of a tree after the frame, with room for the records of its parts.
    fn set_state(
        &mut self,
        world: &LightWorld,
        subject: &Subject,
        mut state: TreeState,
        openings: usize,
        frame: &mut TreeFrame,
    ) -> Result<(), PlanError> {
        let count = TreeRecord::count(openings);
        if state.records.len() as u32 != count {
            state.records = self.records.alloc(count)?;
        }
        (state.openings, state.replaced) = (openings, subject.entry.births.replaced);
        let is_weighed = state.waits || self.residency.is_sorted();
        state.usefulness = if is_weighed { subject.usefulness(world) } else { NOT_WEIGHED };
        self.put(subject.slot, state, frame);
        Ok(())
    }

    /// Sends waiting trees, as far as the frame's bytes and the pools allow. `changed` are the slots of trees that this
    /// frame writes otherwise.
    fn stream(&mut self, world: &LightWorld, changed: &[u32], frame: &mut TreeFrame) -> Result<(), PlanError> {
        for slot in self.residency.next_slots(WEIGHED_PER_FRAME) {
            if let Some(subject) = self.subject(world, slot) {
                self.residency.set_usefulness(slot, subject.usefulness(world));
            }
        }
        self.residency.unblock(MAX_RETRIES);
        let most = self.limits.frame_bytes.map_or(usize::MAX, |_| MAX_BROUGHT);
        let waiting: Vec<u32> = self.residency.waiting().take(most).collect();
        let (mut brought, mut refusals) = (0, 0);
        for slot in waiting {
            if refusals == MAX_REFUSALS {
                break;
            }
            let Some(subject) = self.subject(world, slot) else { continue };
            if self.bring(world, &subject, frame)? {
                brought += 1;
                continue;
            }
            if self.may_not_bring(frame) || self.make_way(world, &subject, changed, frame)? {
                return Ok(());
            }
            refusals += 1;
            // What the frame has brought may leave room behind.
            if brought == 0 {
                let is_older = self.residency.get(slot).form == Form::Whole;
                // An older version makes room for the present one: it would stay for good.
                if !is_older || self.show_stand_ins(world, &subject, frame).is_err() {
                    self.residency.block(slot);
                }
            }
        }
        Ok(())
    }

    /// Whether the frame has no bytes left for trees that have waited, or a tree is under way.
    fn may_not_bring(&self, frame: &TreeFrame) -> bool {
        frame.left == 0 || self.residency.incoming.is_some()
    }

    /// Sends a waiting tree, or its first piece. Returns whether there is room for it.
    fn bring(&mut self, world: &LightWorld, subject: &Subject, frame: &mut TreeFrame) -> Result<bool, PlanError> {
        if self.may_not_bring(frame) {
            return Ok(false);
        }
        let state = self.residency.get(subject.slot).clone();
        if state.bytes <= frame.left && state.form == Form::Whole && has_room_for(&state, subject) {
            frame.left -= state.bytes;
            self.write_in_place(world, subject, state, subject.counts().map(all), frame)?;
            return Ok(true);
        }
        let Some([nodes, lights]) = self.alloc_spare(state.room_for(subject.counts())) else { return Ok(false) };
        self.residency.incoming = Some(Incoming {
            slot: subject.slot,
            key: subject.key,
            nodes,
            lights,
            is_opened: subject.is_opened(),
            sent: [0; 2],
            revision: subject.entry.log.revision(),
            restarts: 0,
        });
        self.go_on(world, frame)?;
        Ok(true)
    }

    /// Sends the next piece of the tree that is under way, if there is one. With the last piece, shaders see it.
    fn go_on(&mut self, world: &LightWorld, frame: &mut TreeFrame) -> Result<(), PlanError> {
        let Some(mut incoming) = self.residency.incoming.take() else { return Ok(()) };
        let state = self.residency.get(incoming.slot).clone();
        let subject = self.subject(world, incoming.slot);
        let Some(subject) = subject.filter(|subject| subject.key == incoming.key && state.waits) else {
            self.nodes.free(incoming.nodes);
            self.lights.free(incoming.lights);
            return Ok(());
        };
        if frame.left == 0 {
            self.residency.incoming = Some(incoming);
            return Ok(());
        }
        let counts = subject.counts();
        let has_room = has_room(&incoming.nodes, counts[0]) && has_room(&incoming.lights, counts[1]);
        if !has_room {
            self.nodes.free(incoming.nodes);
            self.lights.free(incoming.lights);
            let Some(ranges) = self.alloc_spare(with_growth(counts)) else { return Ok(()) };
            [incoming.nodes, incoming.lights] = ranges;
        }
        let is_reopened = incoming.is_opened != subject.is_opened();
        if !has_room || is_reopened || subject.entry.log.since(incoming.revision).is_none() {
            incoming.sent = [0; 2];
            incoming.is_opened = subject.is_opened();
            incoming.revision = subject.entry.log.revision();
            incoming.restarts += 1;
        }
        let mut left = if incoming.restarts > MAX_RESTARTS { u64::MAX } else { frame.left };
        let strides = [Pool::<NodeRecord>::STRIDE, Pool::<LightRecord>::STRIDE];
        let mut pieces = [Vec::new(), Vec::new()];
        for pool in 0..2 {
            let start = incoming.sent[pool];
            // At least one record, however few bytes are left.
            let most = left.div_ceil(strides[pool]).min(u64::from(u32::MAX)) as u32;
            let end = start.saturating_add(most).min(counts[pool] as u32).max(start);
            pieces[pool].extend(std::iter::once(start..end).filter(|piece| !piece.is_empty()));
            incoming.sent[pool] = end;
            let bytes = u64::from(end - start) * strides[pool];
            left = left.saturating_sub(bytes);
            frame.left = frame.left.saturating_sub(bytes);
        }
        let bases = [incoming.nodes.start, incoming.lights.start];
        frame.writes.push(subject.write(Source::Piece, bases, false, pieces));
        if (0..2).any(|pool| (incoming.sent[pool] as usize) < counts[pool]) {
            self.residency.incoming = Some(incoming);
            return Ok(());
        }
        let (runs, _) = subject.changes_since(incoming.revision, subject.openings);
        self.show_whole(world, &subject, state, ([incoming.nodes, incoming.lights], runs), frame)
    }

    /// Makes room for a tree in the next frame: joins gaps, or evicts less useful trees, which fall
    /// back to stand-ins. Returns whether it did either.
    fn make_way(
        &mut self,
        world: &LightWorld,
        subject: &Subject,
        changed: &[u32],
        frame: &mut TreeFrame,
    ) -> Result<bool, PlanError> {
        self.residency.sort();
        let [nodes, lights] = subject.counts().map(|count| count as u64);
        let mut missing = [self.nodes.missing(nodes), self.lights.missing(lights)];
        if missing == [0; 2] {
            return self.join_gaps(world, self.limits.frame_bytes.unwrap_or(MOVED_BYTES), changed, frame);
        }
        let below = (f32::from_bits(self.residency.get(subject.slot).usefulness) / MIN_GAIN).to_bits();
        let mut fallbacks = Vec::new();
        for slot in self.residency.less_useful(below).filter(|slot| !frame.has(changed, *slot)).take(MAX_LOOKED_AT) {
            if missing == [0; 2] {
                break;
            }
            let state = self.residency.get(slot);
            let freed = [state.nodes.len() as u64, state.lights.len() as u64];
            missing = [0, 1].map(|pool: usize| missing[pool].saturating_sub(freed[pool]));
            fallbacks.push(slot);
        }
        if missing != [0; 2] {
            return Ok(false);
        }
        // The next frames evict the rest. Without room for stand-ins a tree stays.
        fallbacks.truncate(MAX_FALLBACKS);
        let subjects = fallbacks.into_iter().filter_map(|slot| self.subject(world, slot));
        let subjects: Vec<Subject> = subjects.collect();
        Ok(subjects.iter().take_while(|subject| self.show_stand_ins(world, subject, frame).is_ok()).count() > 0)
    }

    /// Defragments: moves trees of at most `bytes` bytes from the end of each pool to gaps. Returns
    /// whether it moved any.
    fn join_gaps(
        &mut self,
        world: &LightWorld,
        bytes: u64,
        changed: &[u32],
        frame: &mut TreeFrame,
    ) -> Result<bool, PlanError> {
        let mut left = frame.left.min(bytes);
        self.residency.sort();
        let mut has_moved = false;
        for pool in 0..2 {
            let last: Vec<u32> = self.residency.places_from_last(pool).take(MAX_MOVES).collect();
            for slot in last {
                let state = self.residency.get(slot).clone();
                let Some(subject) = self.subject(world, slot) else { continue };
                let is_current = state.form == Form::Whole
                    && !frame.has(changed, slot)
                    && subject.entry.log.since(state.revision) == Some(TreeChanges::default());
                let mut runs = subject.counts().map(all);
                runs[1 - pool].clear();
                let bytes = self.bytes([length(&runs[0]), length(&runs[1])]);
                if !is_current || bytes > left {
                    continue;
                }
                let mut ranges = [state.nodes.clone(), state.lights.clone()];
                let (start, len) = (ranges[pool].start, ranges[pool].len() as u32);
                let lower = match pool {
                    0 => self.nodes.alloc_before(start, len),
                    _ => self.lights.alloc_before(start, len),
                };
                let Some(lower) = lower else { continue };
                ranges[pool] = lower;
                left -= bytes;
                frame.left = frame.left.saturating_sub(bytes);
                has_moved = true;
                let bases = [ranges[0].start, ranges[1].start];
                let [nodes, lights] = ranges;
                self.set_state(world, &subject, TreeState { nodes, lights, ..state }, subject.openings, frame)?;
                frame.writes.push(subject.write(Source::Piece, bases, false, runs));
            }
        }
        Ok(has_moved)
    }

    /// Adds the slots of instances whose tree has another place or form after the frame.
    pub fn add_placed_instances(&self, world: &LightWorld, frame: &TreeFrame, changes: &mut FrameChanges) {
        for (slot, former) in &frame.placed {
            let state = self.residency.get(*slot);
            let is_same = former.ranges() == state.ranges() && former.form == state.form;
            if is_same
                && former.key == state.key
                && (former.openings, former.replaced) == (state.openings, state.replaced)
            {
                continue;
            }
            if let Some(entry) = world.tree_at(*slot).and_then(|key| world.tree_entry(key)) {
                changes.concern_lights |= !entry.instances.is_empty();
                changes.instances.extend(entry.instances.iter().map(|key| slot_of(*key)));
                changes.parts.extend(entry.instances.iter().map(|key| slot_of(*key)));
            }
        }
        sort(&mut changes.instances);
        sort(&mut changes.parts);
    }
}

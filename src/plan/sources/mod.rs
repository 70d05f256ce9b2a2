//! What the GPU holds of trees whose lights a kernel of the engine writes there, and the commands that
//! refit them.
//!
//! Such a tree lies in the pools as any other. It has beside that a record by which kernels find its
//! lights, and pieces: see `pieces.rs`. A frame refits all of them, the pieces of one pass in one dispatch,
//! and then writes the records of their parts, from which the top level is built.

mod pieces;
mod readback;
mod records;
mod stage;

use pieces::Pieces;
pub use readback::{LightReadback, MeasureReadback, PartReadback};
pub(crate) use records::MeasureRecord;
use records::{RefitCluster, RefitPass, SourceRecord};
use stage::PART_LANES;
pub use stage::wgsl_of_sources;
pub(super) use stage::{PARTS, REFIT};

use std::ops::Range;
use std::sync::Arc;

use super::buffers::BufferId;
use super::commands::Commands;
use super::draft::Draft;
use super::error::PlanError;
use super::kernel::{UNIFORM_ALIGNMENT, pass_bytes};
use super::layout::TreeRecord;
use super::pool::Pool;
use super::residency::{Form, Residency};
use super::room::Frame;
use super::scatter::Scattered;
use super::shared_list::SharedList;
use crate::effects::Effects;
use crate::keys::{TreeKey, slot_of};
use crate::world::{TreeSource, TreeVersion};

/// Records that the first buffers have room for.
const FIRST_RECORDS: u32 = 16;

/// All sources of a world. Empty, and without buffers, until the world has one.
#[derive(Clone)]
pub(super) struct SourceStore {
    table: Pool<SourceRecord>,
    measures: Pool<MeasureRecord>,
    clusters: Pool<RefitCluster>,
    pieces: Pool<[u32; 2]>,
    lists: Pool<u32>,
    /// The uniform of the passes, and how many it has room for.
    uniform: Option<(BufferId, u32)>,
    /// By the number of the source.
    states: SharedList<SourceState>,
    /// What is to be written: the records of these sources, with their pieces if these are others, and the uniform.
    changed: Vec<(u32, Option<Pieces>)>,
    has_new_uniform: bool,
    list: Range<u32>,
    /// The source and the part that are read back next.
    next_part: (u32, u32),
    /// The passes of the last plan.
    passes: Arc<[RefitPass]>,
}

/// A source as the GPU knows it.
#[derive(Clone, Debug, Default)]
struct SourceState {
    /// The tree; `None` for a number that no tree has.
    key: Option<TreeKey>,
    /// The version of the tree that shaders see.
    version: Option<TreeVersion>,
    record: SourceRecord,
    /// The ranges of pairs and clusters.
    pieces: Range<u32>,
    clusters: Range<u32>,
    /// Where the pieces of each pass begin, in the range.
    passes: Vec<Vec<u32>>,
}

impl SourceStore {
    /// No sources. No buffer will be larger than `limit` bytes.
    pub fn new(limit: u64) -> Self {
        Self {
            table: Pool::new("light sources", FIRST_RECORDS, limit),
            measures: Pool::new("measures of sources", FIRST_RECORDS, limit),
            clusters: Pool::new("clusters of sources", FIRST_RECORDS, limit),
            pieces: Pool::new("pieces of sources", FIRST_RECORDS, limit),
            lists: Pool::new("lists of pieces", FIRST_RECORDS, limit),
            uniform: None,
            states: SharedList::default(),
            changed: Vec::new(),
            has_new_uniform: false,
            list: 0..0,
            next_part: (0, 0),
            passes: Arc::default(),
        }
    }

    /// The numbers of the sources whose states depend on what has changed. O(1) if nothing has.
    fn affected(&self, frame: &Frame<'_>) -> Vec<u32> {
        let (world, changes, placed) = (frame.world, frame.changes.trees.as_slice(), &frame.trees.placed);
        let is_none = changes.is_empty() && placed.is_empty();
        let count = if is_none { 0 } else { world.source_numbers().max(self.states.len() as u32) };
        let is_settled = |key: TreeKey| {
            let slot = slot_of(key);
            changes.binary_search(&slot).is_err() && !placed.contains_key(&slot)
        };
        let is_affected = |index: &u32| {
            let of = self.states.get(*index as usize).and_then(|state| state.key);
            of.is_none() || world.source_tree(*index) != of || !of.is_some_and(is_settled)
        };
        (0..count).filter(is_affected).collect()
    }

    /// The state that a source should have after the frame, and whether its pieces have to be made anew.
    fn due(&self, index: u32, frame: &Frame<'_>, trees: &Residency) -> (SourceState, bool) {
        let (world, changes) = (frame.world, &frame.changes);
        let present = self.states.get(index as usize).cloned().unwrap_or_default();
        let Some((key, source)) = world.source_at(index) else { return (SourceState::default(), false) };
        let Some(entry) = world.tree_entry(key) else { return (SourceState::default(), false) };
        let slot = slot_of(key);
        let state = trees.get(slot);
        let is_same = present.key == Some(key);
        let has_profiles = entry.tree.effects().has(Effects::PROFILES);
        if state.form != Form::Whole || entry.tree.nodes().is_empty() || has_profiles {
            return (SourceState { key: Some(key), ..SourceState::default() }, false);
        }
        let is_changed =
            changes.trees.as_slice().binary_search(&slot).is_ok() || frame.trees.placed.contains_key(&slot);
        if is_same && state.waits && present.record.light_count > 0 {
            // Shaders see an older version.
            return (present, false);
        }
        // The parts of particles are their lights, unless the tree is one part.
        let has_pieces = source == TreeSource::GpuMesh || state.openings == 0;
        let record = SourceRecord {
            light_base: state.lights.start,
            light_count: entry.tree.lights().len() as u32,
            node_base: state.nodes.start,
            root: present.record.root,
            record_base: state.records.start,
            record_count: state.records.len() as u32,
            ..SourceRecord::default()
        };
        let record = record.weighed_for(entry.tree.weights());
        let is_stale = !is_same || is_changed || has_pieces == present.pieces.is_empty();
        if is_stale {
            let version = world.version(key);
            return (SourceState { key: Some(key), version, record, ..SourceState::default() }, has_pieces);
        }
        (SourceState { record, ..present }, false)
    }

    /// Finds room for what the sources of a world need, and remembers what is to be written.
    pub fn place(&mut self, frame: &Frame<'_>, trees: &Residency, draft: &mut Draft) -> Result<(), PlanError> {
        let (world, growth) = (frame.world, draft.growth);
        let present = self.states.len() as u32;
        let more = world.source_numbers().saturating_sub(present);
        if present + more == 0 {
            return Ok(());
        }
        self.table.alloc(more, growth)?;
        self.measures.alloc(more, growth)?;
        for index in self.affected(frame) {
            let (mut state, has_new_pieces) = self.due(index, frame, trees);
            let present = self.states.get(index as usize).cloned();
            let is_same = present.as_ref().is_some_and(|p| {
                (p.key, p.version, &p.record, &p.pieces) == (state.key, state.version, &state.record, &state.pieces)
            });
            if is_same && !has_new_pieces {
                continue;
            }
            let mut written = None;
            if let Some(former) = present.filter(|present| present.pieces != state.pieces || has_new_pieces) {
                self.pieces.free(former.pieces);
                self.clusters.free(former.clusters);
            }
            if has_new_pieces && let Some(tree) = state.key.and_then(|key| world.tree(key)) {
                let pieces = Pieces::of(tree, index);
                state.pieces = self.pieces.alloc(pieces.pairs.len() as u32, growth)?;
                state.clusters = self.clusters.alloc(pieces.count, growth)?;
                state.record.root = state.clusters.start;
                state.passes = pieces.passes.clone();
                written = Some(pieces);
            }
            self.states.set(index as usize, state);
            self.changed.push((index, written));
        }
        let (words, passes) = self.sizes();
        if !self.changed.is_empty() {
            self.lists.free(std::mem::take(&mut self.list));
            self.list = self.lists.alloc(words, growth)?;
        }
        self.table.settle(draft);
        self.measures.settle(draft);
        self.clusters.settle(draft);
        self.pieces.settle(draft);
        self.lists.settle(draft);
        if self.uniform.is_none_or(|(_, room)| room < passes) {
            let room = passes.next_power_of_two().max(8);
            let uniform = draft.uniform("refit passes", u64::from(room * UNIFORM_ALIGNMENT));
            draft.plan.freed.extend(self.uniform.replace((uniform, room)).map(|(id, _)| id));
            self.has_new_uniform = true;
        }
        Ok(())
    }

    /// The words of the lists and the number of passes.
    fn sizes(&self) -> (u32, u32) {
        let (mut words, mut passes) = (0, 0);
        for state in self.states.iter() {
            words += state.passes.iter().map(|pass| pass.len() as u32).sum::<u32>();
            words += 2 * state.record.record_count.div_ceil(PART_LANES);
            passes = passes.max(state.passes.len() as u32);
        }
        (words, passes + 1)
    }

    /// Writes what has changed.
    pub fn write(&mut self, commands: &mut Commands) {
        let changed = std::mem::take(&mut self.changed);
        let has_new_uniform = std::mem::take(&mut self.has_new_uniform);
        if changed.is_empty() && !has_new_uniform {
            return;
        }
        let none = &mut Scattered::default();
        for (index, pieces) in &changed {
            let Some(state) = self.states.get(*index as usize) else { continue };
            self.table.write(commands, none, *index..index + 1, [state.record].into_iter());
            if let Some(pieces) = pieces {
                let pairs = pieces.pairs_from(state.clusters.start);
                self.pieces.write(commands, none, state.pieces.clone(), pairs);
            }
        }
        let (list, passes) = self.list_of_passes();
        if !changed.is_empty() {
            self.lists.write(commands, none, self.list.clone(), list.into_iter());
        }
        if (has_new_uniform || *passes != *self.passes)
            && let Some((uniform, _)) = self.uniform
        {
            commands.write(uniform, 0, &pass_bytes(&passes, UNIFORM_ALIGNMENT));
        }
        self.passes = passes.into();
    }

    /// The words of the lists, and the passes that read them. The last pass writes the records of parts.
    fn list_of_passes(&self) -> (Vec<u32>, Vec<RefitPass>) {
        let (mut list, mut passes) = (Vec::new(), Vec::new());
        let mut add = |list: &Vec<u32>, before: usize, words: u32| {
            let (first, count) = (self.list.start + before as u32, (list.len() - before) as u32 / words);
            passes.push(RefitPass { first, count });
        };
        let most = self.states.iter().map(|state| state.passes.len()).max().unwrap_or(0);
        for pass in 0..most {
            let before = list.len();
            for state in self.states.iter() {
                let starts = state.passes.get(pass).into_iter().flatten();
                list.extend(starts.map(|start| state.pieces.start + start));
            }
            add(&list, before, 1);
        }
        let before = list.len();
        for (index, state) in (0..).zip(self.states.iter()) {
            let firsts = (0..state.record.record_count).step_by(PART_LANES as usize);
            list.extend(firsts.flat_map(|first| [index, first]));
        }
        add(&list, before, 2);
        (list, passes)
    }

    /// Whether there is anything to refit.
    pub fn is_active(&self) -> bool {
        self.passes.last().is_some_and(|parts| parts.count > 0)
    }

    /// The device may lack what was written.
    pub fn lose(&mut self) {
        self.passes = Arc::default();
        self.states = self.states.iter().map(|state| SourceState { key: None, ..state.clone() }).collect();
    }

    /// Adds the refit of all trees with a source: a dispatch for each pass, and one for the records.
    pub fn refit(&self, commands: &mut Commands, [nodes, lights, records]: [BufferId; 3]) {
        let Some((uniform, _)) = self.uniform.filter(|_| self.is_active()) else { return };
        let [table, measures] = [self.table.buffer(), self.measures.buffer()];
        let [clusters, pieces, lists] = [self.clusters.buffer(), self.pieces.buffer(), self.lists.buffer()];
        let last = self.passes.len() - 1;
        for (pass, index) in self.passes.iter().zip(0..) {
            let offset = index as u32 * UNIFORM_ALIGNMENT;
            match index == last {
                false => {
                    let buffers = [uniform, nodes, table, clusters, measures, lights, pieces, lists];
                    commands.dispatch(REFIT, &buffers, offset, pass.count);
                }
                true => {
                    let buffers = [uniform, records, table, clusters, nodes, lights, lists, measures];
                    commands.dispatch(PARTS, &buffers, offset, pass.count);
                }
            }
        }
    }

    /// The table that kernels of the engine read; `None` before the first source.
    pub fn table(&self) -> Option<BufferId> {
        self.uniform.map(|_| self.table.buffer())
    }

    /// What the engine reads back of some sources after a refit, the numbers from `first` on: see
    /// [`MeasureReadback`].
    pub fn measures(&self, first: u32, most: u32) -> Option<MeasureReadback> {
        let end = first.saturating_add(most).min(self.states.len() as u32);
        let versions: Vec<_> =
            (first..end).filter_map(|index| self.states.get(index as usize)).map(|state| state.version).collect();
        let stride = Pool::<MeasureRecord>::STRIDE;
        let (offset, bytes) = (u64::from(first) * stride, versions.len() as u64 * stride);
        self.uniform.filter(|_| bytes > 0 && self.is_active())?;
        Some(MeasureReadback { buffer: self.measures.buffer(), offset, bytes, versions })
    }

    /// The next parts to be read back, at most `most`, of a source; each time those that follow on the last ones. `None`
    /// if no source has parts. `records` are the records of all parts. O(sources).
    pub fn next_parts(&mut self, most: u32, records: &Pool<TreeRecord>) -> Option<PartReadback> {
        // The present source may come once more, from its first part on.
        for _ in 0..=self.states.len() {
            let (source, first) = self.next_part;
            if let Some(SourceState { version: Some(version), record, .. }) = self.states.get(source as usize)
                && first < record.record_count
            {
                let end = record.record_count.min(first.saturating_add(most.max(1)));
                self.next_part = (source, end);
                let stride = Pool::<TreeRecord>::STRIDE;
                let (offset, bytes) = (u64::from(record.record_base + first) * stride, u64::from(end - first) * stride);
                let (version, count) = (*version, record.record_count as usize);
                return Some(PartReadback { buffer: records.buffer(), offset, bytes, version, first, count });
            }
            self.next_part = if source < self.states.len() as u32 { (source + 1, 0) } else { (0, 0) };
        }
        None
    }

    /// The number of sources, in use or not.
    pub fn count(&self) -> u32 {
        self.states.len() as u32
    }

    /// The range of the lights of a tree and its version, if it has a source and shaders see it whole. O(sources).
    pub fn lights(&self, tree: TreeKey) -> Option<(TreeVersion, Range<u32>)> {
        let state = self.states.iter().find(|s| s.key == Some(tree) && s.record.light_count > 0)?;
        let SourceRecord { light_base, light_count, .. } = state.record;
        Some((state.version?, light_base..light_base + light_count))
    }
}

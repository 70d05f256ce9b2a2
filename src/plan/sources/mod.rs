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
pub use readback::Readback;
use readback::ReadbackOf;
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
use super::layout::{LightRecord, TreeRecord};
use super::pool::Pool;
use super::residency::{Form, Residency, TreeState};
use super::room::Frame;
use super::shared_list::SharedList;
use crate::effects::Effects;
use crate::keys::{TreeKey, slot_of};
use crate::world::{TreeEntry, TreeSource, TreeVersion};

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
    /// What is to be written: the records of these sources with their pieces, and the list.
    changed: Vec<(u32, Option<Pieces>)>,
    listed: Vec<u32>,
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
            listed: Vec::new(),
            list: 0..0,
            next_part: (0, 0),
            passes: Arc::default(),
        }
    }

    /// Finds room for what the sources of a world need, and remembers what is to be written. O(sources) if trees have
    /// changed.
    pub fn place(&mut self, frame: &Frame<'_>, trees: &Residency, draft: &mut Draft) -> Result<(), PlanError> {
        let has_changed = !frame.changes.trees.is_empty() || !frame.trees.placed.is_empty();
        let count = frame.world.source_numbers().max(self.states.len() as u32);
        if count == 0 || !has_changed {
            return Ok(());
        }
        let more = count.saturating_sub(self.table.used() as u32);
        self.table.alloc(more)?;
        self.measures.alloc(more)?;
        for index in 0..count {
            self.place_source(index, frame, trees)?;
        }
        if self.changed.is_empty() {
            return Ok(());
        }
        let (list, passes) = self.list_of_passes();
        self.lists.free(std::mem::take(&mut self.list));
        self.list = self.lists.alloc(list.len() as u32)?;
        self.listed = list;
        let passes = passes.into_iter().map(|pass| RefitPass { first: self.list.start + pass.first, ..pass });
        self.passes = passes.collect();
        self.table.settle(draft);
        self.measures.settle(draft);
        self.clusters.settle(draft);
        self.pieces.settle(draft);
        self.lists.settle(draft);
        let needed = self.passes.len() as u32;
        if self.uniform.is_none_or(|(_, room)| room < needed) {
            let room = needed.next_power_of_two().max(8);
            let uniform = draft.uniform("refit passes", u64::from(room * UNIFORM_ALIGNMENT));
            draft.plan.freed.extend(self.uniform.replace((uniform, room)).map(|(id, _)| id));
        }
        Ok(())
    }

    /// Finds out what shaders see of a source, if it is another one or its tree has changed.
    fn place_source(&mut self, index: u32, frame: &Frame<'_>, trees: &Residency) -> Result<(), PlanError> {
        let (world, changed) = (frame.world, &frame.changes.trees);
        let source = world.source_at(index);
        let key = source.map(|(key, _)| key);
        let present = self.states.get(index as usize);
        let is_same = present.and_then(|present| present.key) == key;
        if is_same && !key.is_some_and(|key| frame.trees.has(changed, slot_of(key))) {
            return Ok(());
        }
        let former = present.cloned().unwrap_or_default();
        let seen = key.map_or(&TreeState::NONE, |key| trees.get(slot_of(key)));
        if is_same && seen.waits && seen.form == Form::Whole && former.record.light_count > 0 {
            // Shaders see an older version.
            return Ok(());
        }
        self.pieces.free(former.pieces);
        self.clusters.free(former.clusters);
        let (mut state, mut made) = (SourceState { key, ..SourceState::default() }, None);
        if let Some((key, source)) = source
            && let Some(TreeEntry { tree, .. }) = world.tree_entry(key)
            && seen.form == Form::Whole
            && !tree.nodes().is_empty()
            && !tree.effects().has(Effects::PROFILES)
        {
            state.version = world.version(key);
            let record = SourceRecord {
                light_base: seen.lights.start,
                light_count: tree.lights().len() as u32,
                node_base: seen.nodes.start,
                record_base: seen.records.start,
                record_count: seen.records.len() as u32,
                ..SourceRecord::default()
            };
            state.record = record.weighed_for(tree.weights());
            // The parts of particles are their lights, unless the tree is one part.
            if source == TreeSource::GpuMesh || seen.openings == 0 {
                let pieces = Pieces::of(tree, index);
                state.pieces = self.pieces.alloc(pieces.pairs.len() as u32)?;
                state.clusters = self.clusters.alloc(pieces.count)?;
                state.record.root = state.clusters.start;
                state.passes = pieces.passes.clone();
                made = Some(pieces);
            }
        }
        self.states.set(index as usize, state);
        self.changed.push((index, made));
        Ok(())
    }

    /// Writes what has changed.
    pub fn write(&mut self, commands: &mut Commands) {
        let Some((uniform, _)) = self.uniform.filter(|_| !self.changed.is_empty()) else { return };
        for (index, pieces) in std::mem::take(&mut self.changed) {
            let Some(state) = self.states.get(index as usize) else { continue };
            self.table.write(commands, None, index..index + 1, [state.record].into_iter());
            if let Some(pieces) = pieces {
                self.pieces.write(commands, None, state.pieces.clone(), pieces.pairs_from(state.clusters.start));
            }
        }
        self.lists.write(commands, None, self.list.clone(), std::mem::take(&mut self.listed).into_iter());
        commands.write(uniform, 0, &pass_bytes(&self.passes, UNIFORM_ALIGNMENT));
    }

    /// The words of the lists, and the passes that read them. The last pass writes the records of parts.
    fn list_of_passes(&self) -> (Vec<u32>, Vec<RefitPass>) {
        let (mut list, mut passes) = (Vec::new(), Vec::new());
        let most = self.states.iter().map(|state| state.passes.len()).max().unwrap_or(0);
        for pass in 0..most {
            let first = list.len() as u32;
            for state in self.states.iter() {
                let starts = state.passes.get(pass).into_iter().flatten();
                list.extend(starts.map(|start| state.pieces.start + start));
            }
            passes.push(RefitPass { first, count: list.len() as u32 - first });
        }
        let first = list.len() as u32;
        for (index, state) in (0..).zip(self.states.iter()) {
            let firsts = (0..state.record.record_count).step_by(PART_LANES as usize);
            list.extend(firsts.flat_map(|first| [index, first]));
        }
        passes.push(RefitPass { first, count: (list.len() as u32 - first) / 2 });
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

    /// The measures of some sources after a refit, the numbers from `first` on.
    pub fn measures(&self, first: u32, most: u32) -> Option<Readback> {
        let end = first.saturating_add(most).min(self.states.len() as u32);
        let versions: Vec<_> =
            (first..end).filter_map(|index| self.states.get(index as usize)).map(|state| state.version).collect();
        let range = first..first + versions.len() as u32;
        self.uniform.filter(|_| !range.is_empty() && self.is_active())?;
        Some(readback(&self.measures, range, ReadbackOf::Measures(versions)))
    }

    /// The next parts to be read back, at most `most`, of a source; each time those that follow on the last ones. `None`
    /// if no source has parts. `records` are the records of all parts. O(sources).
    pub fn next_parts(&mut self, most: u32, records: &Pool<TreeRecord>) -> Option<Readback> {
        // The present source may come once more, from its first part on.
        for _ in 0..=self.states.len() {
            let (source, first) = self.next_part;
            if let Some(SourceState { version: Some(version), record, .. }) = self.states.get(source as usize)
                && first < record.record_count
            {
                let end = record.record_count.min(first.saturating_add(most.max(1)));
                self.next_part = (source, end);
                let range = record.record_base + first..record.record_base + end;
                return Some(readback(
                    records,
                    range,
                    ReadbackOf::Parts(*version, first, record.record_count as usize),
                ));
            }
            self.next_part = if source < self.states.len() as u32 { (source + 1, 0) } else { (0, 0) };
        }
        None
    }

    /// The number of sources, in use or not.
    pub fn count(&self) -> u32 {
        self.states.len() as u32
    }

    /// The lights of a tree, if it has a source and shaders see it whole. O(sources).
    pub fn lights(&self, tree: TreeKey, lights: &Pool<LightRecord>) -> Option<Readback> {
        let state = self.states.iter().find(|s| s.key == Some(tree) && s.record.light_count > 0)?;
        let SourceRecord { light_base, light_count, .. } = state.record;
        Some(readback(lights, light_base..light_base + light_count, ReadbackOf::Lights(state.version?)))
    }
}

/// A range of the records of a pool.
fn readback<T: bytemuck::NoUninit>(pool: &Pool<T>, range: Range<u32>, what: ReadbackOf) -> Readback {
    let stride = Pool::<T>::STRIDE;
    let (offset, bytes) = (u64::from(range.start) * stride, range.len() as u64 * stride);
    Readback { buffer: pool.buffer(), offset, bytes, what }
}

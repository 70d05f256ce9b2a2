//! The table of parts on the GPU: which parts of the instances are leaves of the top level.
//!
//! An instance has one part for its whole tree, or one for each opening of an opened tree. The parts of
//! an instance are neighbours in the table.

use std::collections::BTreeMap;
use std::ops::Range;

use super::buffers::BufferId;
use super::commands::Commands;
use super::draft::Draft;
use super::error::PlanError;
use super::layout::PartRecord;
use super::pool::Pool;
use super::runs::runs;
use super::shared_list::SharedList;

/// The parts of all instances.
#[derive(Clone)]
pub(super) struct PartTable {
    pool: Pool<PartRecord>,
    /// The parts of each instance slot; empty for a slot without an instance.
    ranges: SharedList<Range<u32>>,
    /// The records to be written.
    changed: BTreeMap<u32, PartRecord>,
    /// Ranges that slots had before. They are freed once all slots have theirs, so that parts keep the order of their
    /// slots where they can: the top level takes parts of crowded cells in the order of the table.
    former: Vec<Range<u32>>,
    /// The device may lack records that were written, so the next write sends all of them.
    has_lost_records: bool,
}

impl PartTable {
    /// An empty table in a buffer of at most `limit_bytes`.
    pub fn new(limit_bytes: u64) -> Self {
        let pool = Pool::new("parts of instances", 64, limit_bytes);
        Self {
            pool,
            ranges: SharedList::default(),
            changed: BTreeMap::new(),
            former: Vec::new(),
            has_lost_records: false,
        }
    }

    /// The parts of a slot.
    pub fn range(&self, slot: u32) -> Range<u32> {
        self.ranges.get(slot as usize).cloned().unwrap_or_default()
    }

    /// The number of parts, free ones among them included.
    pub fn count(&self) -> u32 {
        self.pool.used() as u32
    }

    /// The buffer of the records, which the top-level build reads. Panics before the first plan.
    pub fn buffer(&self) -> BufferId {
        self.pool.buffer()
    }

    /// Gives a slot room for so many parts, 0 without an instance.
    ///
    /// Fails with [`PlanError::Full`] if the buffer would outgrow its limit.
    pub fn place(&mut self, slot: u32, count: u32) -> Result<(), PlanError> {
        let former = self.range(slot);
        if count == former.len() as u32 {
            return Ok(());
        }
        self.changed.extend(former.clone().map(|part| (part, PartRecord::NONE)));
        self.former.push(former);
        let range = self.pool.alloc(count)?;
        self.changed.extend(records_of(slot, &range));
        self.ranges.set(slot as usize, range);
        Ok(())
    }

    /// Frees the ranges in place of which slots have got others.
    pub fn free_former(&mut self) {
        std::mem::take(&mut self.former).into_iter().for_each(|range| self.pool.free(range));
    }

    /// Forgets all ranges, so that the parts of all slots are placed anew, without gaps.
    pub fn restart(&mut self) {
        self.pool.restart();
        self.ranges = SharedList::default();
    }

    /// Makes the next write send all parts again.
    pub fn lose_records(&mut self) {
        self.has_lost_records = true;
    }

    /// Makes the buffer large enough.
    pub fn settle(&mut self, draft: &mut Draft) {
        self.pool.settle(draft);
    }

    /// Writes the records that changed.
    pub fn write(&mut self, commands: &mut Commands) {
        let mut records = std::mem::take(&mut self.changed);
        if std::mem::take(&mut self.has_lost_records) {
            records = (0..self.count()).map(|part| (part, PartRecord::NONE)).collect();
            (0..).zip(self.ranges.iter()).for_each(|(slot, range)| records.extend(records_of(slot, range)));
        }
        // Ranges that were freed may lie beyond those in use.
        for run in runs(records.keys().copied(), 0) {
            let records = records.range(run.clone()).map(|(_, record)| *record);
            self.pool.write(commands, None, run, records);
        }
    }
}

/// The parts of a slot with their records.
fn records_of(slot: u32, range: &Range<u32>) -> impl Iterator<Item = (u32, PartRecord)> + use<> {
    range.clone().zip(0..).map(move |(part, index)| (part, PartRecord { slot, index }))
}

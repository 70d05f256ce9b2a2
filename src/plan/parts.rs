//! The table of parts on the GPU: which parts of the instances are leaves of the top level.
//!
//! An instance has one part for its whole tree, or one for each opening of an opened tree. The parts of
//! an instance are neighbours in the table.

use std::collections::BTreeMap;
use std::ops::Range;

use super::buffers::BufferId;
use super::commands::Commands;
use super::error::PlanError;
use super::layout::PartRecord;
use super::pool::{Growth, Pool, RestartedPool};
use super::runs::runs;
use super::scatter::Scattered;

/// The parts of all instances.
pub(super) struct PartTable {
    pool: Pool<PartRecord>,
    /// The parts of each instance slot; empty for a slot without an instance.
    ranges: Vec<Range<u32>>,
    /// The device may lack records that were written, so the next write sends all of them.
    has_lost_records: bool,
}

/// New ranges for the parts of some slots, which nothing refers to yet.
#[derive(Debug, Default)]
pub(super) struct NewParts(Vec<(u32, Range<u32>)>);

/// The ranges of all parts before a restart.
#[derive(Debug)]
pub(super) struct RestartedParts {
    pool: RestartedPool,
    ranges: Vec<Range<u32>>,
}

impl PartTable {
    /// An empty table in a buffer of at most `limit_bytes`.
    pub fn new(limit_bytes: u64) -> Self {
        // Every layout stores whole records.
        let pool = Pool::new("parts of instances", 64, limit_bytes);
        Self { pool, ranges: Vec::new(), has_lost_records: false }
    }

    /// The parts of a slot.
    pub fn range(&self, slot: u32) -> Range<u32> {
        self.ranges.get(slot as usize).cloned().unwrap_or_default()
    }

    /// The number of parts, free ones among them included.
    pub fn count(&self) -> u32 {
        self.pool.used() as u32
    }

    /// The records, as the top-level build reads them.
    pub fn pool(&mut self) -> &mut Pool<PartRecord> {
        &mut self.pool
    }

    /// The buffer of the records. Panics before the first plan.
    pub fn buffer(&self) -> BufferId {
        self.pool.buffer()
    }

    /// Reserves ranges for those slots whose number of parts has changed. `counts` are slots, each
    /// once, with the number of parts that their instances have now; 0 without an instance. Changes
    /// nothing if it fails, as [`Pool::alloc`] does.
    pub fn reserve(&mut self, counts: impl Iterator<Item = (u32, u32)>, growth: Growth) -> Result<NewParts, PlanError> {
        let mut new = NewParts::default();
        for (slot, count) in counts {
            if count == self.range(slot).len() as u32 {
                continue;
            }
            match self.pool.alloc(count, growth) {
                Ok(range) => new.0.push((slot, range)),
                Err(error) => {
                    self.release(new);
                    return Err(error);
                }
            }
        }
        Ok(new)
    }

    /// Gives reserved ranges back.
    pub fn release(&mut self, new: NewParts) {
        new.0.into_iter().for_each(|(_, range)| self.pool.free(range));
    }

    /// Forgets all ranges, so that the parts of all slots are placed anew, without gaps.
    pub fn restart(&mut self) -> RestartedParts {
        RestartedParts { pool: self.pool.restart(), ranges: std::mem::take(&mut self.ranges) }
    }

    /// Takes a restart back, after the pool was undone.
    pub fn restore(&mut self, former: RestartedParts) {
        self.pool.restore(former.pool);
        self.ranges = former.ranges;
    }

    /// Makes the next write send all parts again.
    pub fn lose_records(&mut self) {
        self.has_lost_records = true;
    }

    /// Writes the parts of reserved ranges, in place of the former parts of their slots.
    pub fn write(&mut self, commands: &mut Commands, new: NewParts) {
        let mut records = BTreeMap::new();
        for (slot, range) in &new.0 {
            let index = *slot as usize;
            if self.ranges.len() <= index {
                self.ranges.resize(index + 1, 0..0);
            }
            let former = std::mem::replace(&mut self.ranges[index], range.clone());
            records.extend(former.clone().map(|part| (part, PartRecord::NONE)));
            self.pool.free(former);
        }
        if std::mem::take(&mut self.has_lost_records) {
            records = (0..self.count()).map(|part| (part, PartRecord::NONE)).collect();
            (0..).zip(&self.ranges).for_each(|(slot, range)| records.extend(records_of(slot, range)));
        }
        new.0.iter().for_each(|(slot, range)| records.extend(records_of(*slot, range)));
        write_runs(commands, &self.pool, &records);
    }
}

/// The parts of a slot with their records.
fn records_of(slot: u32, range: &Range<u32>) -> impl Iterator<Item = (u32, PartRecord)> + use<> {
    range.clone().zip(0..).map(move |(part, index)| (part, PartRecord { slot, index }))
}

/// Writes records, neighbouring ones together.
fn write_runs(commands: &mut Commands, pool: &Pool<PartRecord>, records: &BTreeMap<u32, PartRecord>) {
    for run in runs(records.keys().copied(), 0) {
        let records = records.range(run.clone()).map(|(_, record)| *record);
        pool.write(commands, &mut Scattered::default(), run, records);
    }
}

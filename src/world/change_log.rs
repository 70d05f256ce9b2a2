//! What changed in one tree, for readers that are behind by any number of changes.

use std::collections::VecDeque;

use crate::rare::Rare;
use crate::tree::LEAF;

/// A log keeps one entry for this many nodes and lights of its tree.
const RECORDS_PER_ENTRY: usize = 8;
/// A log keeps at least this many entries.
const LEAST_ENTRIES: usize = 64;

/// A log of the nodes and lights of a tree that were written, in order.
///
/// A reader remembers the [`ChangeLog::revision`] that it has read up to, and gets what changed
/// since. So there may be any number of readers, and none has to report back. Old entries are
/// dropped: a reader that is too far behind reads the whole tree.
#[derive(Clone, Debug)]
pub(crate) struct ChangeLog {
    /// The revision before the first entry.
    start: u64,
    /// Indices of nodes, and those of lights with the bit [`LEAF`].
    entries: Rare<VecDeque<u32>>,
}

/// The nodes and lights that changed: ascending indices, each once.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct TreeChanges {
    pub nodes: Vec<u32>,
    pub lights: Vec<u32>,
}

impl Default for ChangeLog {
    /// The log of a new tree. A reader at revision 0 has read nothing of it.
    fn default() -> Self {
        Self { start: 1, entries: Rare::default() }
    }
}

impl ChangeLog {
    /// Grows with each change.
    pub fn revision(&self) -> u64 {
        self.start + self.entries.len() as u64
    }

    /// The size of the log in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.entries.memory_bytes()
    }

    /// Records that the whole tree changed: all readers have to read all of it.
    pub fn restart(&mut self) {
        self.start = self.revision() + 1;
        if !self.entries.is_empty() {
            self.entries.clear();
        }
    }

    /// Records that nodes and lights changed, in a tree of `records` nodes and lights together.
    /// Allocates at the first call only, unless the tree grows.
    pub fn add(&mut self, nodes: &[u32], lights: impl ExactSizeIterator<Item = u32>, records: usize) {
        let room = LEAST_ENTRIES.max(records / RECORDS_PER_ENTRY);
        let added = nodes.len() + lights.len();
        if added == 0 {
            return;
        }
        if added > room {
            return self.restart();
        }
        let surplus = (self.entries.len() + added).saturating_sub(room);
        self.entries.drain(..surplus);
        self.start += surplus as u64;
        if self.entries.capacity() < room {
            let held = self.entries.len();
            self.entries.reserve_exact(room - held);
        }
        self.entries.extend(nodes);
        self.entries.extend(lights.map(|light| light | LEAF));
    }

    /// What changed after a revision; `None` if that was everything, or if it is not known any
    /// more.
    pub fn since(&self, revision: u64) -> Option<TreeChanges> {
        let read = usize::try_from(revision.checked_sub(self.start)?).ok()?;
        let mut entries: Vec<u32> = self.entries.range(read.min(self.entries.len())..).copied().collect();
        entries.sort_unstable();
        entries.dedup();
        let nodes = entries.partition_point(|entry| entry & LEAF == 0);
        let lights = entries[nodes..].iter().map(|entry| entry & !LEAF).collect();
        entries.truncate(nodes);
        Some(TreeChanges { nodes: entries, lights })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn add(log: &mut ChangeLog, nodes: &[u32], lights: &[u32]) -> u64 {
        log.add(nodes, lights.iter().copied(), 0);
        log.revision()
    }

    #[test]
    fn each_reader_gets_what_changed_since_it_read() {
        let mut log = ChangeLog::default();
        assert_eq!(log.since(0), None, "nothing was read yet");
        let first = log.revision();
        assert_eq!(log.since(first), Some(TreeChanges::default()));
        let second = add(&mut log, &[7, 2, 7], &[5, 1]);
        add(&mut log, &[2, 9], &[1]);
        assert_eq!(log.since(first), Some(TreeChanges { nodes: vec![2, 7, 9], lights: vec![1, 5] }));
        assert_eq!(log.since(second), Some(TreeChanges { nodes: vec![2, 9], lights: vec![1] }));
        assert_eq!(log.since(log.revision()), Some(TreeChanges::default()));
        log.restart();
        assert_eq!([first, second].map(|revision| log.since(revision)), [None, None]);
        assert_eq!(log.since(log.revision()), Some(TreeChanges::default()));
    }

    #[test]
    fn a_reader_that_keeps_up_never_reads_the_whole_tree_and_one_that_falls_behind_does() {
        let mut log = ChangeLog::default();
        let (behind, mut read) = (log.revision(), log.revision());
        for i in 0..1000 {
            add(&mut log, &[i], &[i]);
            assert_eq!(log.since(read), Some(TreeChanges { nodes: vec![i], lights: vec![i] }));
            read = log.revision();
            assert_eq!(log.since(behind).is_none(), 2 * (i as usize + 1) > LEAST_ENTRIES);
            assert!(log.entries.len() <= LEAST_ENTRIES && log.entries.capacity() < 2 * LEAST_ENTRIES);
        }
    }

    #[test]
    fn more_changes_than_the_log_holds_count_as_a_change_of_everything() {
        let mut log = ChangeLog::default();
        let before = log.revision();
        let all: Vec<u32> = (0..1 + LEAST_ENTRIES as u32).collect();
        add(&mut log, &all, &[]);
        assert_eq!(log.since(before), None);
        log.add(&all, std::iter::empty(), all.len() * RECORDS_PER_ENTRY);
        assert_eq!(log.since(log.revision() - all.len() as u64), Some(TreeChanges { nodes: all, lights: vec![] }));
    }
}

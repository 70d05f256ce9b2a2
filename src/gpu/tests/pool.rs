//! Pools: growth, gaps, and limits.

use std::ops::Range;

use super::Rig;
use crate::plan::draft::{Draft, Growth};
use crate::plan::pool::Pool;
use crate::plan::{BufferId, PlanError};

/// A pool whose every call is a frame of its own.
pub(super) struct TestPool<T> {
    pub pool: Pool<T>,
    /// The buffers that it had.
    former: Vec<BufferId>,
}

impl<T: bytemuck::NoUninit> TestPool<T> {
    pub fn new(rig: &mut Rig, capacity: u32, limit_bytes: u64) -> Self {
        let pool = Pool::new("test records", capacity, limit_bytes);
        let mut pool = Self { pool, former: Vec::new() };
        pool.frame(rig, |_| Ok(())).expect("an empty pool fits");
        pool
    }

    /// Plays the frame in which `change` changes the pool.
    fn frame<R>(
        &mut self,
        rig: &mut Rig,
        change: impl FnOnce(&mut Pool<T>) -> Result<R, PlanError>,
    ) -> Result<R, PlanError> {
        let result = change(&mut self.pool)?;
        rig.draft(Growth::Double, |draft| {
            self.pool.settle(draft);
            self.former.extend(&draft.plan.freed);
        });
        Ok(result)
    }

    pub fn alloc(&mut self, rig: &mut Rig, len: u32) -> Result<Range<u32>, PlanError> {
        self.frame(rig, |pool| pool.alloc(len))
    }

    /// Returns the bytes sent.
    pub fn write(&self, rig: &mut Rig, first: u32, records: &[T]) -> u64 {
        let mut sent = 0;
        rig.play(&[], |commands| {
            let run = first..first + records.len() as u32;
            self.pool.write(commands, None, run, records.iter().copied());
            sent = commands.bytes_written();
        });
        sent
    }

    /// How often the buffer was replaced, and how many records it holds.
    fn state(&self) -> (usize, u32) {
        (self.former.len(), self.pool.capacity())
    }
}

/// A record of 16 bytes, the most common size in WGSL.
type Record = [u32; 4];

fn records(range: Range<u32>, salt: u32) -> Vec<Record> {
    range.map(|i| [salt, i, i ^ salt, !i]).collect()
}

fn pool(rig: &mut Rig, capacity: u32, limit: u64) -> TestPool<Record> {
    TestPool::new(rig, capacity, limit)
}

const LIMIT: u64 = 128 << 20;

#[test]
fn growth_keeps_what_was_written_before_it_and_clears_the_rest() {
    let mut rig = Rig::new();
    let mut pool = pool(&mut rig, 2, LIMIT);
    let mut expected = Vec::new();
    let mut states = vec![pool.state()];
    for (salt, len) in [(1, 2), (2, 1), (3, 5), (4, 40)] {
        let range = pool.alloc(&mut rig, len).unwrap();
        assert_eq!(range.start as usize, expected.len());
        assert_eq!(pool.write(&mut rig, range.start, &records(range.clone(), salt)), u64::from(len) * 16);
        expected.extend(records(range, salt));
        states.push(pool.state());
    }
    // A write to an old range after the growth wins over the copy.
    pool.write(&mut rig, 1, &[[9; 4]]);
    expected[1] = [9; 4];
    assert_eq!(states, [(0, 2), (0, 2), (1, 4), (2, 8), (3, 48)]);
    assert_eq!(rig.read::<Record>(pool.pool.buffer()), expected);
    pool.alloc(&mut rig, 1).unwrap();
    expected.resize(96, [0; 4]);
    assert_eq!(rig.read::<Record>(pool.pool.buffer()), expected, "what was not written is zero");
}

#[test]
fn writes_before_and_after_a_growth_in_one_list_arrive_in_order() {
    let mut rig = Rig::new();
    let mut pool = pool(&mut rig, 2, LIMIT);
    pool.alloc(&mut rig, 2).unwrap();
    let mut draft = Draft::new(rig.ids, Growth::Exact);
    let write = |pool: &Pool<Record>, commands: &mut _, record: Record| {
        pool.write(commands, None, 1..2, std::iter::once(record));
    };
    write(&pool.pool, &mut draft.plan.upload, [1; 4]);
    pool.pool.alloc(1).unwrap();
    pool.pool.settle(&mut draft);
    write(&pool.pool, &mut draft.plan.upload, [2; 4]);
    rig.player.create(&draft.plan.new_buffers).expect("room enough");
    rig.player.play(&draft.plan.upload);
    assert_eq!(rig.read::<Record>(draft.plan.freed[0])[1], [1; 4]);
    assert_eq!(rig.read::<Record>(pool.pool.buffer())[1], [2; 4]);
}

#[test]
fn a_freed_range_is_reused_without_growth() {
    let mut rig = Rig::new();
    let mut pool = pool(&mut rig, 16, LIMIT);
    let first = pool.alloc(&mut rig, 8).unwrap();
    let second = pool.alloc(&mut rig, 8).unwrap();
    pool.pool.free(first.clone());
    assert_eq!(pool.alloc(&mut rig, 5).unwrap(), 0..5);
    assert_eq!(pool.alloc(&mut rig, 3).unwrap(), 5..8);
    pool.pool.free(second);
    assert_eq!(pool.alloc(&mut rig, 8).unwrap(), 8..16);
    assert_eq!(pool.state(), (0, 16));
}

#[test]
fn a_range_of_no_records_takes_no_room() {
    let mut rig = Rig::new();
    let mut pool = pool(&mut rig, 0, LIMIT);
    let nothing = pool.alloc(&mut rig, 0).unwrap();
    assert!(nothing.is_empty());
    assert_eq!(pool.write(&mut rig, nothing.start, &[]), 0);
    pool.pool.free(nothing);
    assert_eq!(pool.alloc(&mut rig, 1).unwrap(), 0..1);
    assert_eq!(pool.state(), (0, 1));
}

#[test]
fn a_pool_can_be_filled_to_its_limit_and_refuses_one_record_more_without_a_change() {
    let mut rig = Rig::new();
    let mut pool = pool(&mut rig, 4, 24 * 16);
    let first = pool.alloc(&mut rig, 13).unwrap();
    pool.write(&mut rig, first.start, &records(first.clone(), 7));
    let refused = PlanError::Full { what: "test records", needed: 25 * 16, limit: 24 * 16 };
    assert_eq!(pool.alloc(&mut rig, 12), Err(refused));
    assert_eq!(refused.to_string(), "test records need a buffer of 400 bytes; the limit is 384");
    assert_eq!(
        pool.alloc(&mut rig, u32::MAX).unwrap_err(),
        PlanError::Full { what: "test records", needed: (u64::from(u32::MAX) + 13) * 16, limit: 24 * 16 }
    );
    assert_eq!(pool.state(), (1, 13));
    // Twice 13 is past the limit; growth stops at the limit.
    assert_eq!(pool.alloc(&mut rig, 11).unwrap(), 13..24);
    assert_eq!(pool.state(), (2, 24));
    assert_eq!(rig.read::<Record>(pool.pool.buffer())[..13], records(first, 7)[..]);
    // A gap that is too short is no use; one that is long enough is reused.
    pool.pool.free(3..5);
    assert!(pool.alloc(&mut rig, 3).is_err());
    assert_eq!(pool.alloc(&mut rig, 2).unwrap(), 3..5);
}

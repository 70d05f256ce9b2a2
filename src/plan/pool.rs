//! A storage buffer whose ranges are allocated and freed, and which grows by doubling.

use std::marker::PhantomData;
use std::ops::Range;

use super::buffers::BufferId;
use super::commands::Commands;
use super::draft::{Draft, Growth};
use super::error::PlanError;
use super::frame::FramePlan;
use super::ranges::Ranges;
use super::scatter::Scattered;

/// Threads take this many records at a time, and share the work of four times as many.
#[cfg(feature = "parallel")]
const RECORDS_PER_TASK: usize = 1024;

/// One part in this many of the limit of a pool is kept for what cannot do without room.
pub(super) const SPARE: u64 = 8;

/// A pool of limited memory grows by steps of this factor, up to its whole share. So it copies no
/// more than a sixteenth of its share.
const STEP: u64 = 16;

/// Records of type `T` in one storage buffer. Ranges are in records, never in bytes.
///
/// Ranges are allocated first, whatever room the buffer has. [`Pool::settle`] then makes a larger buffer, if one is
/// needed, and only then may records be written.
#[derive(Clone)]
pub(crate) struct Pool<T> {
    /// Names the records, in the plural.
    what: &'static str,
    /// The largest buffer.
    limit_bytes: u64,
    /// The bytes of a limited memory that the pool may take.
    share: Option<u64>,
    /// `None` before the first plan.
    buffer: Option<BufferId>,
    /// Records that the buffer has room for, or that the first one will have.
    capacity: u32,
    ranges: Ranges,
    records: PhantomData<T>,
}

impl<T: bytemuck::NoUninit> Pool<T> {
    /// Bytes from one record to the next.
    pub(crate) const STRIDE: u64 = size_of::<T>() as u64;

    /// An empty pool that will have room for `capacity` records, at least one, in a buffer of at
    /// most `limit_bytes`. `what` names the records in errors and in graphics debuggers, in the
    /// plural.
    pub(crate) fn new(what: &'static str, capacity: u32, limit_bytes: u64) -> Self {
        const { assert!(size_of::<T>() != 0 && size_of::<T>().is_multiple_of(4), "writes are whole 4-byte words") };
        Self {
            what,
            limit_bytes,
            share: None,
            buffer: None,
            capacity: capacity.max(1),
            ranges: Ranges::default(),
            records: PhantomData,
        }
    }

    /// Limits the bytes of the buffer, from the next frame on.
    pub(crate) fn set_share(&mut self, share: Option<u64>) {
        self.share = share;
    }

    /// Fails with [`PlanError::Full`] if more is in use than the limit, which has fallen.
    pub(crate) fn keep_limit(&self) -> Result<(), PlanError> {
        let used = self.used();
        if used > self.limit() { Err(self.full(used)) } else { Ok(()) }
    }

    /// Reserves `len` contiguous records. Their content is undefined until it is written. A range of no records is empty
    /// and need not be freed.
    ///
    /// Fails with [`PlanError::Full`] and changes nothing if the buffer would outgrow its limit.
    pub(crate) fn alloc(&mut self, len: u32) -> Result<Range<u32>, PlanError> {
        if len == 0 {
            return Ok(0..0);
        }
        let range = self.ranges.take(u64::from(len), self.limit());
        // Within the limit, which is a u32.
        range.map(|range| range.start as u32..range.end as u32).ok_or_else(|| self.full(self.used() + u64::from(len)))
    }

    /// As [`Pool::alloc`], for a range before a place; `None` unless there is a gap.
    pub(crate) fn alloc_before(&mut self, place: u32, len: u32) -> Option<Range<u32>> {
        self.ranges.gap_for(len.into()).filter(|start| *start < u64::from(place))?;
        self.alloc(len).ok()
    }

    /// How many more records have to be free, gaps aside, before there is room for `len` records that leaves enough for
    /// what cannot do without.
    pub(crate) fn missing(&self, len: u64) -> u64 {
        let limit = self.limit();
        (self.taken() + len + limit / SPARE).saturating_sub(limit)
    }

    /// Forgets all ranges.
    pub(crate) fn restart(&mut self) {
        self.ranges = Ranges::default();
    }

    /// Gives a range back. It must come from [`Pool::alloc`] of this pool and be freed once.
    pub(crate) fn free(&mut self, range: Range<u32>) {
        self.ranges.free(u64::from(range.start)..u64::from(range.end));
    }

    /// Makes a buffer with room for all ranges and within the limit, if the present one is not: adds the commands that
    /// bring the records there and set the rest to zero.
    pub(crate) fn settle(&mut self, draft: &mut Draft) {
        let room = self.room(draft.growth);
        if self.buffer.is_some() && room == self.capacity {
            return;
        }
        let new = draft.storage(self.what, u64::from(room) * Self::STRIDE);
        let former = self.buffer.replace(new);
        let kept = match former {
            Some(_) => self.used().min(self.capacity.into()) * Self::STRIDE,
            None => 0,
        };
        let FramePlan { upload, freed, .. } = &mut draft.plan;
        former.into_iter().for_each(|former| upload.copy(former, (new, 0), kept));
        freed.extend(former);
        upload.zero(new, kept..u64::from(room) * Self::STRIDE);
        self.capacity = room;
    }

    /// The records that the buffer should have room for.
    fn room(&self, growth: Growth) -> u32 {
        let (used, limit, capacity) = (self.used(), self.limit(), u64::from(self.capacity));
        let steps = [limit / (STEP * STEP), limit / STEP];
        let room = match growth {
            _ if used <= capacity => capacity,
            Growth::Exact => used,
            Growth::Double if self.share.is_none() => used.max(2 * capacity),
            Growth::Double => steps.into_iter().find(|step| *step >= used).unwrap_or(limit),
        };
        room.min(limit) as u32
    }

    /// Overwrites the records of a run with the given ones, as many as it is long. Short runs may go
    /// to `scattered`.
    pub(crate) fn write(
        &self,
        commands: &mut Commands,
        scattered: Option<&mut Scattered>,
        run: Range<u32>,
        records: impl Iterator<Item = T>,
    ) {
        assert!(run.end <= self.capacity, "{run:?} does not fit into {}", self.capacity);
        let start = u64::from(run.start) * Self::STRIDE;
        let append = |bytes: &mut Vec<u8>| {
            records.for_each(|record| bytes.extend_from_slice(bytemuck::bytes_of(&record)));
        };
        match scattered.and_then(|scattered| scattered.add(&run)) {
            Some(bytes) => append(bytes),
            None => commands.write_with(self.buffer(), start, append),
        }
    }

    /// [`Pool::write`] of a record for each index of a run. Threads share the work of long runs.
    pub(crate) fn write_each(
        &self,
        commands: &mut Commands,
        scattered: &mut Scattered,
        run: Range<u32>,
        record: impl Fn(u32) -> T + Sync,
    ) {
        #[cfg(feature = "parallel")]
        if run.len() >= 4 * RECORDS_PER_TASK && rayon::current_num_threads() > 1 {
            use rayon::prelude::*;
            assert!(run.end <= self.capacity, "{run:?} does not fit into {}", self.capacity);
            let stride = size_of::<T>();
            commands.write_with(self.buffer(), u64::from(run.start) * Self::STRIDE, |bytes| {
                let first = bytes.len();
                bytes.resize(first + run.len() * stride, 0);
                let tasks = bytes[first..].par_chunks_mut(RECORDS_PER_TASK * stride);
                tasks.zip(run.into_par_iter().step_by(RECORDS_PER_TASK)).for_each(|(bytes, start)| {
                    for (index, bytes) in (start..).zip(bytes.chunks_exact_mut(stride)) {
                        bytes.copy_from_slice(bytemuck::bytes_of(&record(index)));
                    }
                });
            });
            return;
        }
        self.write(commands, Some(scattered), run.clone(), run.map(record));
    }

    /// The buffer. Panics before the first plan.
    pub(crate) fn buffer(&self) -> BufferId {
        self.buffer.expect("the first plan has made the buffer")
    }

    /// Records that the buffer has room for.
    pub(crate) fn capacity(&self) -> u32 {
        self.capacity
    }

    /// Records in use.
    pub(crate) fn taken(&self) -> u64 {
        self.ranges.taken()
    }

    /// The size of the buffer.
    pub(crate) fn bytes(&self) -> u64 {
        u64::from(self.capacity) * Self::STRIDE
    }

    /// The end of the last range in use.
    pub(crate) fn used(&self) -> u64 {
        self.ranges.end()
    }

    /// The most records that a buffer may have.
    pub(crate) fn limit(&self) -> u64 {
        let bytes = self.share.map_or(self.limit_bytes, |share| share.min(self.limit_bytes));
        (bytes / Self::STRIDE).min(u32::MAX.into())
    }

    fn full(&self, records: u64) -> PlanError {
        PlanError::Full { what: self.what, needed: records * Self::STRIDE, limit: self.limit() * Self::STRIDE }
    }
}

#[cfg(all(test, feature = "parallel"))]
mod tests {
    use super::super::buffers::Ids;
    use super::super::layout::InstanceRecord;
    use super::*;

    #[test]
    fn threads_write_the_bytes_of_one_thread() {
        const SHARED: u32 = 4 * RECORDS_PER_TASK as u32;
        let mut pool = Pool::<InstanceRecord>::new("instances", 20 * SHARED, u64::MAX);
        pool.buffer = Some(Ids::default().next());
        let record = |index: u32| bytemuck::cast(std::array::from_fn::<u32, 40, _>(|word| 100 * index + word as u32));
        for length in [100, SHARED - 1, SHARED, SHARED + 1, 10 * SHARED + 7] {
            let written = |threads| {
                let mut commands = Commands::default();
                let write = || pool.write_each(&mut commands, &mut Scattered::default(), 5..5 + length, record);
                let threads = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                threads.install(write);
                commands
            };
            let [one, two] = [1, 2].map(written);
            assert_eq!(one.bytes_written(), u64::from(length) * Pool::<InstanceRecord>::STRIDE);
            assert!(one.iter().eq(two.iter()), "{length} records");
        }
    }
}

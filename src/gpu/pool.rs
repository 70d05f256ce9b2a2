//! A storage buffer whose ranges are allocated and freed, and which grows by doubling.

use std::marker::PhantomData;
use std::ops::Range;

use range_alloc::RangeAllocator;

use super::error::{GpuError, largest_storage_buffer};
use super::memory;
use super::relayout::Relayout;
use super::stored::{Missing, Stored};

/// Records of type `T` in one storage buffer. Ranges are in records, never in bytes.
pub(crate) struct Pool<T> {
    device: wgpu::Device,
    queue: wgpu::Queue,
    /// Names the records, in the plural.
    what: &'static str,
    buffer: wgpu::Buffer,
    /// In u64, because the allocator doubles the lengths that it is given.
    ranges: RangeAllocator<u64>,
    /// The most records that a buffer can hold in the present layout.
    limit: u32,
    limit_bytes: u64,
    /// Which parts of a record the buffer holds.
    stored: Stored,
    generation: u64,
    records: PhantomData<T>,
}

/// A new buffer for the records of a pool in another layout: what [`Pool::prepare_layout`] makes
/// and [`Pool::adopt_layout`] takes.
pub(crate) struct PreparedLayout {
    stored: Stored,
    buffer: wgpu::Buffer,
    capacity: u32,
    limit: u32,
}

impl<T: bytemuck::NoUninit> Pool<T> {
    /// An empty pool with room for `capacity` records; at least one, since WebGPU binds no empty
    /// buffer. `what` names the records in errors and in graphics debuggers, in the plural.
    pub(crate) fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        what: &'static str,
        capacity: u32,
    ) -> Result<Self, GpuError> {
        Self::with_limit(device, queue, what, capacity, largest_storage_buffer(device))
    }

    /// A pool whose buffer holds at most `limit_bytes`.
    pub(crate) fn with_limit(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        what: &'static str,
        capacity: u32,
        limit_bytes: u64,
    ) -> Result<Self, GpuError> {
        const { assert!(size_of::<T>() != 0 && size_of::<T>().is_multiple_of(4), "WebGPU copies whole 4-byte words") };
        let limit_bytes = limit_bytes.min(largest_storage_buffer(device));
        let stored = Stored::whole::<T>();
        let limit = limit_of(limit_bytes, &stored);
        let capacity = capacity.max(1);
        if capacity > limit {
            let stride = stored.bytes() as u64;
            return Err(GpuError::Full {
                what,
                needed: u64::from(capacity) * stride,
                limit: u64::from(limit) * stride,
            });
        }
        Ok(Self {
            device: device.clone(),
            queue: queue.clone(),
            what,
            buffer: create(device, what, capacity, &stored)?,
            ranges: RangeAllocator::new(0..u64::from(capacity)),
            limit,
            limit_bytes,
            stored,
            generation: 0,
            records: PhantomData,
        })
    }

    /// Reserves `len` contiguous records, and grows the buffer if no gap is long enough. Their
    /// content is undefined until it is written. A range of no records is empty and need not be
    /// freed.
    ///
    /// Fails and changes nothing: with [`GpuError::Full`] if the buffer would outgrow its limit,
    /// with [`GpuError::OutOfMemory`] if the device has no room for it.
    pub(crate) fn alloc(&mut self, len: u32) -> Result<Range<u32>, GpuError> {
        if len == 0 {
            return Ok(0..0);
        }
        if let Some(range) = self.take(len) {
            return Ok(range);
        }
        // No gap is long enough, so the range begins after the last one in use.
        let used = self.used();
        let needed = used + u64::from(len);
        if needed > u64::from(self.limit) {
            let limit = u64::from(self.limit) * self.stride();
            return Err(GpuError::Full { what: self.what, needed: needed * self.stride(), limit });
        }
        let needed = needed as u32;
        let doubled = self.capacity().saturating_mul(2).min(self.limit);
        // Short of memory, the exact size may still fit.
        self.grow(doubled.max(needed), used)
            .or_else(|error| if doubled > needed { self.grow(needed, used) } else { Err(error) })?;
        Ok(self.take(len).expect("the pool has just grown by enough"))
    }

    /// Reserves from what is free.
    fn take(&mut self, len: u32) -> Option<Range<u32>> {
        let range = self.ranges.allocate_range(u64::from(len)).ok()?;
        // Within the capacity, which is a u32.
        Some(range.start as u32..range.end as u32)
    }

    /// Gives a range back. It must come from [`Pool::alloc`] of this pool and be freed once.
    pub(crate) fn free(&mut self, range: Range<u32>) {
        if !range.is_empty() {
            self.ranges.free_range(u64::from(range.start)..u64::from(range.end));
        }
    }

    /// Overwrites the records from `first` on, ahead of the next submission to the queue. Sends
    /// only the stored parts. Returns the bytes sent.
    pub(crate) fn write(&self, first: u32, records: &[T]) -> u64 {
        if records.is_empty() {
            return 0;
        }
        assert!(
            u64::from(first) + records.len() as u64 <= u64::from(self.capacity()),
            "{} records from {first} on do not fit into {}",
            records.len(),
            self.capacity()
        );
        let whole: &[u8] = bytemuck::cast_slice(records);
        let stripped = self.stored.strip(whole);
        let bytes = stripped.as_deref().unwrap_or(whole);
        self.queue.write_buffer(&self.buffer, u64::from(first) * self.stride(), bytes);
        bytes.len() as u64
    }

    /// The whole buffer; another object after each change of [`Pool::generation`].
    pub(crate) fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// Changes when the buffer is replaced: bind groups with the old buffer must then be replaced.
    pub(crate) fn generation(&self) -> u64 {
        self.generation
    }

    /// Records that the buffer has room for.
    pub(crate) fn capacity(&self) -> u32 {
        self.ranges.initial_range().end as u32
    }

    /// Whether no range is in use.
    pub(crate) fn is_empty(&self) -> bool {
        self.used() == 0
    }

    /// Replaces the buffer by one of `capacity` records and copies the first `used` ones over.
    fn grow(&mut self, capacity: u32, used: u64) -> Result<(), GpuError> {
        let buffer = create(&self.device, self.what, capacity, &self.stored)?;
        // The queue runs writes before the next submission. Submitting the copy here puts it after
        // every write to the old buffer and before every write to the new one.
        if used > 0 {
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_buffer_to_buffer(&self.buffer, 0, &buffer, 0, used * self.stride());
            self.queue.submit([encoder.finish()]);
        }
        self.buffer = buffer;
        self.ranges.grow_to(u64::from(capacity));
        self.generation += 1;
        Ok(())
    }

    /// Makes a buffer for the same records in another layout; `None` if they have that layout
    /// already. Changes nothing.
    ///
    /// Fails as [`Pool::alloc`] does.
    pub(crate) fn prepare_layout(&self, stored: Stored) -> Result<Option<PreparedLayout>, GpuError> {
        if stored == self.stored {
            return Ok(None);
        }
        self.prepare(stored).map(Some)
    }

    fn prepare(&self, stored: Stored) -> Result<PreparedLayout, GpuError> {
        let (stride, limit) = (stored.bytes() as u64, limit_of(self.limit_bytes, &stored));
        let used = self.used();
        if used > u64::from(limit) {
            let (needed, limit) = (used * stride, u64::from(limit) * stride);
            return Err(GpuError::Full { what: self.what, needed, limit });
        }
        let capacity = self.capacity().min(limit);
        let buffer = create(&self.device, self.what, capacity, &stored)?;
        Ok(PreparedLayout { stored, buffer, capacity, limit })
    }

    /// Replaces the buffer by a prepared one. The GPU converts the records; the conversion is
    /// submitted at once, as growth is. `relayout` may be `None` if the pool is empty. No range may
    /// have been reserved since the layout was prepared. Returns the bytes sent.
    pub(crate) fn adopt_layout(
        &mut self,
        prepared: PreparedLayout,
        missing: fn(usize) -> Missing,
        relayout: Option<&Relayout>,
    ) -> u64 {
        let PreparedLayout { stored, buffer, capacity, limit } = prepared;
        let mut sent = 0;
        if let Ok(used @ 1..) = u32::try_from(self.used()) {
            let from = (&self.buffer, &self.stored);
            let relayout = relayout.expect("a pool with records comes with a pipeline to convert them");
            sent = relayout.submit((&self.device, &self.queue), used, from, (&buffer, &stored), missing);
        }
        if capacity < self.capacity() {
            self.ranges = cut(&self.ranges, u64::from(capacity));
        }
        self.buffer = buffer;
        self.stored = stored;
        self.limit = limit;
        self.generation += 1;
        sent
    }

    /// Converts the records at once, also to the layout that they have. They must fit.
    #[cfg(test)]
    pub(crate) fn set_layout(&mut self, stored: Stored, missing: fn(usize) -> Missing, relayout: &Relayout) -> u64 {
        let prepared = self.prepare(stored).expect("the records fit");
        self.adopt_layout(prepared, missing, Some(relayout))
    }

    /// Bytes from one record to the next.
    fn stride(&self) -> u64 {
        self.stored.bytes() as u64
    }

    /// The end of the last range in use.
    pub(crate) fn used(&self) -> u64 {
        self.ranges.allocated_ranges().last().map_or(0, |r| r.end)
    }
}

/// The number of records that a buffer of `limit_bytes` holds.
fn limit_of(limit_bytes: u64, stored: &Stored) -> u32 {
    u32::try_from(limit_bytes / stored.bytes() as u64).unwrap_or(u32::MAX)
}

fn create(device: &wgpu::Device, what: &'static str, capacity: u32, stored: &Stored) -> Result<wgpu::Buffer, GpuError> {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
    memory::create_buffer(device, what, u64::from(capacity) * stored.bytes() as u64, usage)
}

/// The same ranges in an allocator with less room, since an allocator only grows. All of them must
/// end before `end`.
fn cut(ranges: &RangeAllocator<u64>, end: u64) -> RangeAllocator<u64> {
    let mut smaller = RangeAllocator::new(0..end);
    let mut gaps = Vec::new();
    let mut at = 0;
    // Taken in order from one free range, each range follows the last.
    let mut take = |len: u64| smaller.allocate_range(len).expect("all ranges fit");
    for used in ranges.allocated_ranges() {
        if used.start > at {
            gaps.push(take(used.start - at));
        }
        at = take(used.end - used.start).end;
    }
    gaps.into_iter().for_each(|gap| smaller.free_range(gap));
    smaller
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::Effects;
    use crate::gpu::layout::InstanceRecord;
    use crate::gpu::memory::refusals::Refusals;
    use crate::gpu::stored::missing_of_instance;
    use crate::gpu::testing::{gpu, noop, read};

    /// A record of 16 bytes, the most common size in WGSL.
    type Record = [u32; 4];

    fn records(range: Range<u32>, salt: u32) -> Vec<Record> {
        range.map(|i| [salt, i, i ^ salt, !i]).collect()
    }

    #[test]
    fn growth_keeps_what_was_written_before_it_and_what_is_written_after() {
        let (device, queue) = gpu();
        let mut pool = Pool::<Record>::new(&device, &queue, "test records", 2).unwrap();
        let mut expected = Vec::new();
        let mut generations = vec![pool.generation()];
        // Nothing is submitted between these writes: all but the first wait in the queue when the
        // pool grows.
        for (salt, len) in [(1, 2), (2, 1), (3, 5), (4, 40)] {
            let range = pool.alloc(len).unwrap();
            assert_eq!(range.start as usize, expected.len());
            assert_eq!(pool.write(range.start, &records(range.clone(), salt)), u64::from(len) * 16);
            expected.extend(records(range, salt));
            generations.push(pool.generation());
        }
        // A write to an old range after the growth must win over the copy.
        pool.write(1, &[[9; 4]]);
        expected[1] = [9; 4];
        assert_eq!(generations, [0, 0, 1, 2, 3]);
        assert_eq!(pool.capacity(), 48);
        assert_eq!(read::<Record>(&device, &queue, pool.buffer())[..48], expected[..]);
    }

    #[test]
    fn a_freed_range_is_reused_without_growth() {
        let (device, queue) = gpu();
        let mut pool = Pool::<Record>::new(&device, &queue, "test records", 16).unwrap();
        let first = pool.alloc(8).unwrap();
        let second = pool.alloc(8).unwrap();
        pool.free(first.clone());
        assert_eq!(pool.alloc(5).unwrap(), 0..5);
        assert_eq!(pool.alloc(3).unwrap(), 5..8);
        pool.free(second);
        assert_eq!(pool.alloc(8).unwrap(), 8..16);
        assert_eq!((pool.generation(), pool.capacity()), (0, 16));
    }

    #[test]
    fn a_range_of_no_records_takes_no_room() {
        let (device, queue) = gpu();
        let mut pool = Pool::<Record>::new(&device, &queue, "test records", 0).unwrap();
        let nothing = pool.alloc(0).unwrap();
        assert!(nothing.is_empty());
        assert_eq!(pool.write(nothing.start, &[]), 0);
        pool.free(nothing);
        assert_eq!(pool.alloc(1).unwrap(), 0..1);
        assert_eq!(pool.generation(), 0);
    }

    #[test]
    fn a_pool_can_be_filled_to_its_limit_and_refuses_one_record_more_without_a_change() {
        let (device, queue) = gpu();
        let mut pool = Pool::<Record>::with_limit(&device, &queue, "test records", 4, 24 * 16).unwrap();
        let first = pool.alloc(13).unwrap();
        pool.write(first.start, &records(first.clone(), 7));
        let refused = GpuError::Full { what: "test records", needed: 25 * 16, limit: 24 * 16 };
        assert_eq!(pool.alloc(12), Err(refused));
        assert_eq!(refused.to_string(), "test records need a buffer of 400 bytes; the limit is 384");
        assert_eq!(
            pool.alloc(u32::MAX).unwrap_err(),
            GpuError::Full { what: "test records", needed: (u64::from(u32::MAX) + 13) * 16, limit: 24 * 16 }
        );
        assert_eq!((pool.generation(), pool.capacity()), (1, 13));
        // Twice 13 is past the limit; growth stops at the limit.
        assert_eq!(pool.alloc(11).unwrap(), 13..24);
        assert_eq!((pool.generation(), pool.capacity()), (2, 24));
        assert_eq!(read::<Record>(&device, &queue, pool.buffer())[..13], records(first, 7)[..]);
        // A gap that is too short is no use; one that is long enough is reused.
        pool.free(3..5);
        assert!(pool.alloc(3).is_err());
        assert_eq!(pool.alloc(2).unwrap(), 3..5);
    }

    #[test]
    fn a_change_to_longer_records_keeps_ranges_and_gaps_or_is_refused() {
        let (device, queue) = gpu();
        let relayout = Relayout::new(&device).expect("room enough");
        let mut pool = Pool::<InstanceRecord>::with_limit(&device, &queue, "test records", 1, 24 * 80).unwrap();
        pool.set_layout(Stored::instances(Effects::empty()), missing_of_instance, &relayout);
        let ranges: Vec<_> = [3, 4, 3, 14].map(|len| pool.alloc(len).unwrap()).into();
        pool.write(7, &[InstanceRecord { tree: 5, ..InstanceRecord::NONE }]);
        let whole = Stored::instances(Effects::all());
        let refused = GpuError::Full { what: "test records", needed: 24 * 144, limit: 13 * 144 };
        assert_eq!(pool.prepare_layout(whole.clone()).err(), Some(refused));
        pool.free(ranges[3].clone());
        pool.free(ranges[1].clone());
        assert!(pool.prepare_layout(whole.clone()).is_ok_and(|prepared| prepared.is_some()));
        let before = pool.generation();
        pool.set_layout(whole.clone(), missing_of_instance, &relayout);
        assert!(pool.prepare_layout(whole).is_ok_and(|prepared| prepared.is_none()), "it has this layout");
        assert_eq!((pool.capacity(), pool.generation()), (13, before + 1));
        assert_eq!(read::<InstanceRecord>(&device, &queue, pool.buffer())[7].tree, 5);
        assert_eq!((pool.alloc(4).unwrap(), pool.alloc(3).unwrap()), (3..7, 10..13));
        assert!(pool.alloc(1).is_err());
        pool.set_layout(Stored::instances(Effects::empty()), missing_of_instance, &relayout);
        assert_eq!(pool.alloc(11).unwrap(), 13..24);
    }

    #[test]
    fn a_capacity_beyond_the_limit_of_the_device_is_refused_at_creation() {
        let (device, queue) = gpu();
        let limit = largest_storage_buffer(&device);
        assert_eq!(limit, wgpu::Limits::default().max_storage_buffer_binding_size);
        let past = u32::try_from(limit / 16).unwrap() + 1;
        let error = Pool::<Record>::new(&device, &queue, "test records", past).err();
        assert_eq!(error, Some(GpuError::Full { what: "test records", needed: limit + 16, limit }));
    }

    #[test]
    fn growth_without_memory_changes_nothing_and_falls_back_to_the_exact_size() {
        let (device, queue) = noop();
        let mut pool = Pool::<Record>::new(&device, &queue, "test records", 16).unwrap();
        let (buffer, _) = (pool.buffer().clone(), pool.alloc(16).unwrap());
        let refusals = Refusals::of_buffers_after(0);
        let refused = GpuError::OutOfMemory { what: "test records", bytes: 17 * 16 };
        assert_eq!(pool.alloc(1), Err(refused));
        assert_eq!(refusals.count(), 2, "first 32 records are tried, then 17");
        assert_eq!((pool.generation(), pool.capacity(), pool.buffer()), (0, 16, &buffer));
        drop(refusals);
        assert_eq!((pool.alloc(1).unwrap(), pool.capacity()), (16..17, 32));
    }
}

//! A storage buffer that hands out ranges of itself and grows by doubling.

use std::marker::PhantomData;
use std::ops::Range;

use range_alloc::RangeAllocator;

use super::error::{GpuError, largest_storage_buffer};
use super::relayout::Relayout;
use super::stored::{Missing, Stored};

/// Records of type `T` in one storage buffer. Ranges are in records, never in bytes.
pub(crate) struct Pool<T> {
    device: wgpu::Device,
    queue: wgpu::Queue,
    what: &'static str,
    buffer: wgpu::Buffer,
    /// In u64, since the allocator doubles the lengths that it is given.
    ranges: RangeAllocator<u64>,
    limit: u32,
    limit_bytes: u64,
    /// What of a record the buffer holds.
    stored: Stored,
    generation: u64,
    records: PhantomData<T>,
}

impl<T: bytemuck::NoUninit> Pool<T> {
    /// An empty pool with room for `capacity` records (at least one, since WebGPU binds no empty buffer).
    /// `what` names the records in errors and in graphics debuggers, in the plural.
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
            buffer: create(device, what, capacity, &stored),
            ranges: RangeAllocator::new(0..u64::from(capacity)),
            limit,
            limit_bytes,
            stored,
            generation: 0,
            records: PhantomData,
        })
    }

    /// Reserves `len` records in one piece, growing the buffer where none is free; their content is undefined
    /// until written. The range of no records is empty and need not be freed.
    ///
    /// Fails with [`GpuError::Full`] and changes nothing where the buffer would outgrow its limit.
    pub(crate) fn alloc(&mut self, len: u32) -> Result<Range<u32>, GpuError> {
        if len == 0 {
            return Ok(0..0);
        }
        if let Some(range) = self.take(len) {
            return Ok(range);
        }
        // No gap is long enough, so the range has to begin behind the last one in use.
        let used = self.used();
        let needed = used + u64::from(len);
        if needed > u64::from(self.limit) {
            let limit = u64::from(self.limit) * self.stride();
            return Err(GpuError::Full { what: self.what, needed: needed * self.stride(), limit });
        }
        let doubled = self.capacity().saturating_mul(2).min(self.limit);
        self.grow(doubled.max(needed as u32), used);
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

    /// Overwrites records from `first` on, of which what is stored is sent, before the next submission to the queue.
    /// Returns the bytes sent.
    pub(crate) fn write(&self, first: u32, records: &[T]) -> u64 {
        if records.is_empty() {
            return 0;
        }
        assert!(
            u64::from(first) + records.len() as u64 <= u64::from(self.capacity()),
            "{} from {first} on do not fit in {}",
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

    /// Changes when the buffer is replaced, so that whoever bound the old one binds again.
    pub(crate) fn generation(&self) -> u64 {
        self.generation
    }

    /// Records that the buffer has room for.
    pub(crate) fn capacity(&self) -> u32 {
        self.ranges.initial_range().end as u32
    }

    /// Replaces the buffer by one of `capacity` records and copies the first `used` ones over.
    fn grow(&mut self, capacity: u32, used: u64) {
        let buffer = create(&self.device, self.what, capacity, &self.stored);
        // The queue runs writes before the next submission. Submitting the copy here puts it after every write to the
        // old buffer and before every write to the new one.
        if used > 0 {
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_buffer_to_buffer(&self.buffer, 0, &buffer, 0, used * self.stride());
            self.queue.submit([encoder.finish()]);
        }
        self.buffer = buffer;
        self.ranges.grow_to(u64::from(capacity));
        self.generation += 1;
    }

    /// Whether the records would fit in another layout.
    pub(crate) fn check_layout(&self, stored: &Stored) -> Result<(), GpuError> {
        let (stride, limit) = (stored.bytes() as u64, limit_of(self.limit_bytes, stored));
        if self.used() > u64::from(limit) {
            let (needed, limit) = (self.used() * stride, u64::from(limit) * stride);
            return Err(GpuError::Full { what: self.what, needed, limit });
        }
        Ok(())
    }

    /// Replaces the buffer by one that holds the same records in another layout, made of the old on the GPU and
    /// submitted at once, as growth is. They must fit, see [`Pool::check_layout`]. Returns the bytes sent.
    pub(crate) fn set_layout(&mut self, stored: Stored, missing: fn(usize) -> Missing, relayout: &Relayout) -> u64 {
        let limit = limit_of(self.limit_bytes, &stored);
        let capacity = self.capacity().min(limit);
        let buffer = create(&self.device, self.what, capacity, &stored);
        let mut sent = 0;
        if let Ok(used @ 1..) = u32::try_from(self.used()) {
            let from = (&self.buffer, &self.stored);
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

    /// What of a record the buffer holds.
    pub(crate) fn stored(&self) -> &Stored {
        &self.stored
    }

    /// Bytes from one record to the next.
    fn stride(&self) -> u64 {
        self.stored.bytes() as u64
    }

    /// The end of the last range in use.
    fn used(&self) -> u64 {
        self.ranges.allocated_ranges().last().map_or(0, |r| r.end)
    }
}

/// Records that a buffer of so many bytes holds.
fn limit_of(limit_bytes: u64, stored: &Stored) -> u32 {
    u32::try_from(limit_bytes / stored.bytes() as u64).unwrap_or(u32::MAX)
}

fn create(device: &wgpu::Device, what: &'static str, capacity: u32, stored: &Stored) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(what),
        size: u64::from(capacity) * stored.bytes() as u64,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// The same ranges within less room, which must hold them all: an allocator only grows.
fn cut(ranges: &RangeAllocator<u64>, end: u64) -> RangeAllocator<u64> {
    let mut fewer = RangeAllocator::new(0..end);
    let mut gaps = Vec::new();
    let mut at = 0;
    // Taken in order from one piece, each lies behind the last.
    let mut take = |len: u64| fewer.allocate_range(len).expect("all fit");
    for used in ranges.allocated_ranges() {
        if used.start > at {
            gaps.push(take(used.start - at));
        }
        at = take(used.end - used.start).end;
    }
    gaps.into_iter().for_each(|gap| fewer.free_range(gap));
    fewer
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::Effects;
    use crate::gpu::layout::InstanceRecord;
    use crate::gpu::stored::missing_of_instance;
    use crate::gpu::testing::{gpu, read};

    /// A record of 16 bytes, the commonest size in WGSL.
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
        // No submission of ours lies between these writes: all but the first wait in the queue when the pool grows.
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
    fn a_freed_range_is_used_again_without_growth() {
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
    fn no_records_take_no_room() {
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
    fn the_limit_can_be_reached_and_one_record_past_it_is_refused_and_changes_nothing() {
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
        // Doubling 13 would pass the limit; growth stops at it.
        assert_eq!(pool.alloc(11).unwrap(), 13..24);
        assert_eq!((pool.generation(), pool.capacity()), (2, 24));
        assert_eq!(read::<Record>(&device, &queue, pool.buffer())[..13], records(first, 7)[..]);
        // A gap that is too short does not help, one that is long enough does.
        pool.free(3..5);
        assert!(pool.alloc(3).is_err());
        assert_eq!(pool.alloc(2).unwrap(), 3..5);
    }

    #[test]
    fn a_layout_that_needs_more_keeps_ranges_and_gaps_or_is_refused() {
        let (device, queue) = gpu();
        let relayout = Relayout::default();
        let mut pool = Pool::<InstanceRecord>::with_limit(&device, &queue, "test records", 1, 24 * 80).unwrap();
        pool.set_layout(Stored::instances(Effects::empty()), missing_of_instance, &relayout);
        let ranges: Vec<_> = [3, 4, 3, 14].map(|len| pool.alloc(len).unwrap()).into();
        pool.write(7, &[InstanceRecord { tree: 5, ..InstanceRecord::NONE }]);
        let whole = Stored::instances(Effects::all());
        let refused = GpuError::Full { what: "test records", needed: 24 * 128, limit: 15 * 128 };
        assert_eq!(pool.check_layout(&whole), Err(refused));
        pool.free(ranges[3].clone());
        pool.free(ranges[1].clone());
        assert_eq!(pool.check_layout(&whole), Ok(()));
        let before = pool.generation();
        pool.set_layout(whole, missing_of_instance, &relayout);
        assert_eq!((pool.capacity(), pool.generation()), (15, before + 1));
        assert_eq!(read::<InstanceRecord>(&device, &queue, pool.buffer())[7].tree, 5);
        assert_eq!((pool.alloc(4).unwrap(), pool.alloc(5).unwrap()), (3..7, 10..15));
        assert!(pool.alloc(1).is_err());
        pool.set_layout(Stored::instances(Effects::empty()), missing_of_instance, &relayout);
        assert_eq!(pool.alloc(9).unwrap(), 15..24);
    }

    #[test]
    fn a_capacity_past_the_devices_limit_is_refused_at_creation() {
        let (device, queue) = gpu();
        let limit = largest_storage_buffer(&device);
        assert_eq!(limit, wgpu::Limits::default().max_storage_buffer_binding_size);
        let past = u32::try_from(limit / 16).unwrap() + 1;
        let error = Pool::<Record>::new(&device, &queue, "test records", past).err();
        assert_eq!(error, Some(GpuError::Full { what: "test records", needed: limit + 16, limit }));
    }
}

//! The usage counters and the instances that they belong to.
//!
//! A counter is a word for each instance slot. No instance has slot 0; its word selects the calls
//! that shaders count. Two rules keep the usage of one instance from being credited to a later
//! instance of its slot:
//!
//! 1. The upload that reports the departure of an instance also sets its counter to zero, ahead of
//!    all work that is submitted later.
//! 2. A collection that was recorded before that upload is not credited to any instance for that
//!    slot. The number of the first collection that belongs to an owner is kept with the owner.
//!
//! So a collection copies the counters and nothing else.

use std::sync::OnceLock;

use super::super::bindings::{bind_lights, usage_layout};
use super::super::error::GpuError;
use super::super::memory;
use super::kernel::UsageKernel;
use super::ring::Ring;
use crate::keys::InstanceKey;
use crate::plan::BufferId;
use crate::world::LightWorld;

/// The largest interval; see [`UsageCounters::set_interval`].
const MAX_INTERVAL: u32 = 1 << 31;

/// Counters that every buffer has room for.
const MIN_CAPACITY: u32 = 64;

/// Written over counters, a piece at a time.
const ZEROS: [u8; 1024] = [0; 1024];

/// The counters, their owners, and the collections on their way back.
pub(in crate::gpu) struct UsageCounters {
    pub layout: wgpu::BindGroupLayout,
    pub bind_group: wgpu::BindGroup,
    /// The light buffers that the bind group was made for; `None` if the counters were replaced.
    bound: Option<[BufferId; 5]>,
    counts: wgpu::Buffer,
    /// The owner of each slot as of the last upload.
    owners: Vec<Owner>,
    /// One call in this many is counted; 0 for none.
    interval: u32,
    /// The next upload takes over all instances and starts from zero.
    is_new: bool,
    ring: Ring,
    /// The counts of the last `take`, by slot.
    sums: Vec<u32>,
    /// Made when our own kernels are first counted.
    pub kernel: OnceLock<UsageKernel>,
}

/// How often lights of each instance were chosen: what
/// [`GpuLights::take_usage`](super::super::GpuLights::take_usage) returns.
///
/// Counts are of sampled calls: with an interval of n, a count of c represents about c · n
/// choices. Only their shares matter to
/// [`LightWorld::record_usage`](crate::LightWorld::record_usage), which takes
/// [`UsageCounts::iter`].
#[derive(Clone, Copy, Debug)]
pub struct UsageCounts<'a> {
    owners: &'a [Owner],
    sums: &'a [u32],
    total: u64,
}

impl UsageCounts<'_> {
    /// The instances with counted choices, each once, with their counts. Instances that were
    /// removed before the last upload are left out. O(slots).
    pub fn iter(&self) -> impl Iterator<Item = (InstanceKey, u32)> {
        let used = self.owners.iter().zip(self.sums).filter(|(_, sum)| **sum > 0);
        used.filter_map(|(owner, sum)| Some((owner.key?, *sum)))
    }

    /// The sum of all counts. O(1).
    pub fn total(&self) -> u64 {
        self.total
    }
}

/// The instance of a slot.
#[derive(Clone, Copy, Debug, Default)]
struct Owner {
    key: Option<InstanceKey>,
    /// The first collection whose count for the slot belongs to the instance alone.
    first_collection: u64,
}

impl Owner {
    fn owns(&self, collection: u64) -> bool {
        self.key.is_some() && self.first_collection <= collection
    }
}

/// A buffer of zeros for at least `slots` counters.
pub(in crate::gpu) fn zeros(device: &wgpu::Device, slots: u32) -> Result<wgpu::Buffer, GpuError> {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
    memory::create_buffer(device, "usage counters", u64::from(slots.max(MIN_CAPACITY)) * 4, usage)
}

impl UsageCounters {
    /// Counts nothing yet. `counts` is a buffer of [`zeros`] and `lights` are the other buffers of
    /// the bind group.
    pub fn new(device: &wgpu::Device, counts: wgpu::Buffer, lights: &[&wgpu::Buffer]) -> Self {
        let layout = usage_layout(device);
        let bind_group = bind(device, &layout, lights, &counts);
        Self {
            layout,
            bind_group,
            bound: None,
            counts,
            owners: Vec::new(),
            interval: 0,
            is_new: true,
            ring: Ring::default(),
            sums: Vec::new(),
            kernel: OnceLock::new(),
        }
    }

    pub fn is_counting(&self) -> bool {
        self.interval > 0
    }

    /// Starts from zero with the next upload.
    pub fn restart(&mut self) {
        self.is_new = true;
    }

    /// Sets the interval, ahead of the next submission: one call in `interval` is counted.
    pub fn set_interval(&mut self, queue: &wgpu::Queue, interval: u32) {
        // While nothing was counted, the owners were not kept up to date.
        self.is_new |= !self.is_counting();
        self.interval = interval.min(MAX_INTERVAL);
        self.write_interval(queue);
    }

    /// Returns the bytes sent.
    fn write_interval(&self, queue: &wgpu::Queue) -> u64 {
        // Hashes are spread evenly over all words, so one in `interval` is at most this.
        let max_hash = match self.interval {
            0 => 0,
            interval => ((1_u64 << 32) / u64::from(interval) - 1) as u32,
        };
        queue.write_buffer(&self.counts, 0, bytemuck::bytes_of(&max_hash));
        4
    }

    /// The buffer that [`UsageCounters::follow`] needs for this number of slots, if it needs
    /// another one.
    ///
    /// Fails with [`GpuError::OutOfMemory`].
    pub fn reserve(&self, device: &wgpu::Device, slots: u32) -> Result<Option<wgpu::Buffer>, GpuError> {
        let capacity = (self.counts.size() / 4) as u32;
        let is_full = slots > capacity;
        // To start from zero always takes another buffer: the old one may be full of counts.
        if !self.is_counting() || !(is_full || self.is_new) {
            return Ok(None);
        }
        let capacity = if is_full { slots.max(capacity.saturating_mul(2)) } else { capacity };
        zeros(device, capacity).map(Some)
    }

    /// Records which instances own these slots now. `reserved` comes from
    /// [`UsageCounters::reserve`] for as many slots as the world has. Returns the bytes sent.
    pub fn follow(
        &mut self,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        reserved: Option<wgpu::Buffer>,
        slots: &[u32],
        world: &LightWorld,
    ) -> u64 {
        if !self.is_counting() {
            return 0;
        }
        if let Some(counts) = reserved {
            if self.is_new {
                return self.start(queue, counts, world);
            }
            self.grow(device, queue, counts);
        }
        let slot_count = world.slot_count().max(self.owners.len());
        self.owners.resize(slot_count, Owner::default());
        let first_collection = self.ring.next();
        let mut sent = 0;
        // Neighbouring counters are set to zero together.
        let (mut first, mut count) = (0, 0);
        for slot in slots {
            let key = world.instance_at(*slot);
            let Some(owner) = self.owners.get_mut(*slot as usize) else { continue };
            let former = owner.key;
            if former == key {
                continue;
            }
            *owner = Owner { key, first_collection };
            if former.is_some() {
                if first + count != *slot {
                    sent += self.clear(queue, first, count);
                    (first, count) = (*slot, 0);
                }
                count += 1;
            }
        }
        sent + self.clear(queue, first, count)
    }

    /// Starts from zero with the instances of the world. Returns the bytes sent.
    fn start(&mut self, queue: &wgpu::Queue, counts: wgpu::Buffer, world: &LightWorld) -> u64 {
        self.counts = counts;
        self.bound = None;
        self.is_new = false;
        let first_collection = self.ring.next();
        self.owners.clear();
        let slots = 0..world.slot_count() as u32;
        self.owners.extend(slots.map(|slot| Owner { key: world.instance_at(slot), first_collection }));
        self.write_interval(queue)
    }

    /// Moves the counts to a larger buffer.
    fn grow(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, counts: wgpu::Buffer) {
        // Submitted at once, as a pool's growth is: after every write to the old buffer and before
        // every write to the new one.
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(&self.counts, 0, &counts, 0, self.counts.size());
        queue.submit([encoder.finish()]);
        self.counts = counts;
        self.bound = None;
    }

    /// Sets counters to zero, ahead of the next submission. Returns the bytes sent.
    fn clear(&self, queue: &wgpu::Queue, first: u32, count: u32) -> u64 {
        let (mut at, end) = (u64::from(first) * 4, u64::from(first + count) * 4);
        while at < end {
            let piece = &ZEROS[..ZEROS.len().min((end - at) as usize)];
            queue.write_buffer(&self.counts, at, piece);
            at += piece.len() as u64;
        }
        u64::from(count) * 4
    }

    /// Replaces the bind group if a buffer of it was replaced. `identity` identifies the light
    /// buffers.
    pub fn rebind(&mut self, device: &wgpu::Device, lights: &[&wgpu::Buffer], identity: Option<[BufferId; 5]>) {
        if self.bound.is_none() || self.bound != identity {
            self.bind_group = bind(device, &self.layout, lights, &self.counts);
            self.bound = identity;
        }
    }

    /// Records that the counts are copied and set to zero, if a buffer for the copy is free.
    pub fn collect(&mut self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder) {
        let bytes = 4 * self.owners.len() as u64;
        let is_empty = self.owners.len() <= 1;
        if is_empty || !self.is_counting() || self.is_new {
            return;
        }
        if self.ring.record(device, encoder, &self.counts, bytes) {
            encoder.clear_buffer(&self.counts, 4, Some(bytes - 4));
        }
    }

    /// Adds up the collections that have arrived, by slot.
    pub fn take(&mut self, device: &wgpu::Device) -> Option<UsageCounts<'_>> {
        let Self { owners, sums, ring, .. } = self;
        sums.clear();
        sums.resize(owners.len(), 0);
        let mut total = 0;
        let has_any = ring.take(device, |collection, bytes| {
            // In browsers the bytes need not be aligned to words.
            let counts = bytes.as_chunks().0.iter().map(|word| u32::from_ne_bytes(*word));
            for ((owner, sum), count) in owners.iter().zip(sums.iter_mut()).zip(counts).skip(1) {
                if count > 0 && owner.owns(collection) {
                    total += u64::from(count);
                    *sum = sum.saturating_add(count);
                }
            }
        });
        has_any.then_some(UsageCounts { owners, sums, total })
    }
}

fn bind(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    lights: &[&wgpu::Buffer],
    counts: &wgpu::Buffer,
) -> wgpu::BindGroup {
    let buffers: Vec<_> = lights.iter().copied().chain([counts]).collect();
    bind_lights(device, layout, &buffers)
}

//! How often lights of each instance are picked: counted by shaders, brought back some frames later without waiting.
//!
//! Counters are words by slot; the first, which is no instance's, tells the shader how many picks to count. Two things
//! keep an instance from another's picks. A slot that somebody leaves is set to zero by the upload that says so, ahead
//! of what is submitted after it; and what a collection that was recorded before then brings for the slot is nobody's
//! (`owners.rs`). So nothing needs to be copied for each collection but the counts themselves.

mod kernel;
mod owners;
mod ring;

use std::collections::BTreeSet;
use std::sync::OnceLock;

pub(super) use kernel::Chosen;
use kernel::UsageKernel;
use owners::Owner;
use ring::Ring;

use super::shader::LightShader;
use super::{GpuLights, bind_group, counting_layout, text};
use crate::effects::Effects;
use crate::keys::InstanceKey;
use crate::world::LightWorld;

/// Counts one pick of sixteen: some hundred thousand a frame of two million pixels, which is more than enough to tell
/// what is seen, and few enough not to queue up at the counters. For [`GpuLights::count_usage`].
pub const DEFAULT_USAGE_INTERVAL: u32 = 16;

/// One pick in so many is the least that is counted.
const MAX_USAGE_INTERVAL: u32 = 1 << 31;

/// What is written over slots that somebody left, a piece at a time.
const ZEROS: [u8; 1024] = [0; 1024];

/// The counters, who they belong to, and what is on its way back.
pub(super) struct UsageCounters {
    layout: wgpu::BindGroupLayout,
    counts: wgpu::Buffer,
    /// Who each slot belongs to as of the last upload.
    owners: Vec<Owner>,
    /// One pick in so many is counted; 0 for none.
    one_in: u32,
    /// The next upload looks at all slots, and starts from zero.
    is_new: bool,
    ring: Ring,
    /// What has arrived, added up, by slot.
    sums: Vec<u32>,
    /// Made when our own kernels first count.
    kernel: OnceLock<UsageKernel>,
    bind_group: wgpu::BindGroup,
    /// The bind group still names the former counters.
    is_unbound: bool,
    /// Of the lights' buffers that the bind group was made for.
    bound: [u64; 4],
}

/// How often lights of each instance were picked: what [`GpuLights::take_usage`] returns.
#[derive(Clone, Copy, Debug)]
pub struct UsageCounts<'a> {
    owners: &'a [Owner],
    sums: &'a [u32],
    total: u64,
}

impl UsageCounts<'_> {
    /// The instances that were picked, each once, with the picks that were counted: one of
    /// [`GpuLights::count_usage`]' so many. None of those are listed that the last upload removed. O(slots).
    pub fn iter(&self) -> impl Iterator<Item = (InstanceKey, u32)> {
        let picked = self.owners.iter().zip(self.sums).filter(|(_, sum)| **sum > 0);
        picked.filter_map(|(owner, sum)| Some((owner.key()?, *sum)))
    }

    /// The sum of all. O(1).
    pub fn total(&self) -> u64 {
        self.total
    }
}

impl UsageCounters {
    fn new(lights: &GpuLights) -> Self {
        let layout = counting_layout(&lights.device);
        let counts = counters(&lights.device, 0, lights.params.slots);
        let bind_group = bind_group(&lights.device, &layout, &lights.buffers(Some(&counts)));
        Self {
            layout,
            counts,
            owners: Vec::new(),
            one_in: 0,
            is_new: true,
            ring: Ring::default(),
            sums: Vec::new(),
            kernel: OnceLock::new(),
            bind_group,
            is_unbound: false,
            bound: lights.bound,
        }
    }

    /// Slots that there is room for.
    fn capacity(&self) -> u32 {
        (self.counts.size() / 4) as u32
    }

    /// Returns the bytes sent.
    fn send_thinning(&self, queue: &wgpu::Queue) -> u64 {
        // Hashes are spread over all words, so that one in `one_in` is at most this.
        let most = match self.one_in {
            0 => 0,
            one_in => ((1_u64 << 32) / u64::from(one_in) - 1) as u32,
        };
        queue.write_buffer(&self.counts, 0, bytemuck::bytes_of(&most));
        4
    }

    /// Sets counters to zero ahead of the next submission. Returns the bytes sent.
    fn forget(&self, queue: &wgpu::Queue, first: u32, count: u32) -> u64 {
        let (mut at, end) = (u64::from(first) * 4, u64::from(first + count) * 4);
        while at < end {
            let piece = &ZEROS[..ZEROS.len().min((end - at) as usize)];
            queue.write_buffer(&self.counts, at, piece);
            at += piece.len() as u64;
        }
        u64::from(count) * 4
    }

    /// Starts from zero with the instances that are there. Returns the bytes sent.
    fn start(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, world: &LightWorld) -> u64 {
        let slots = world.slot_count() as u32;
        self.counts = counters(device, self.capacity(), slots);
        self.is_unbound = true;
        self.is_new = false;
        let next = self.ring.next();
        self.owners.clear();
        self.owners.extend((0..slots).map(|slot| Owner::new(world.instance_at(slot), next)));
        self.send_thinning(queue)
    }

    /// Makes room for so many slots, and keeps what was counted.
    fn grow(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, slots: u32) {
        self.owners.resize(slots as usize, Owner::default());
        if slots > self.capacity() {
            let counts = counters(device, self.capacity(), slots);
            // As in a pool's growth: after every write to the old buffer, before every write to the new one.
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_buffer_to_buffer(&self.counts, 0, &counts, 0, self.counts.size());
            queue.submit([encoder.finish()]);
            self.counts = counts;
            self.is_unbound = true;
        }
    }

    /// Notes who has these slots now. Returns the bytes sent.
    fn follow(
        &mut self,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        slots: &BTreeSet<u32>,
        world: &LightWorld,
    ) -> u64 {
        if self.one_in == 0 {
            return 0;
        }
        if self.is_new {
            return self.start(device, queue, world);
        }
        if world.slot_count() > self.owners.len() {
            self.grow(device, queue, world.slot_count() as u32);
        }
        let next = self.ring.next();
        let mut sent = 0;
        // Neighbours that somebody left, which are written together.
        let (mut first, mut count) = (0, 0);
        for slot in slots {
            let key = world.instance_at(*slot);
            let Some(owner) = self.owners.get_mut(*slot as usize) else { continue };
            let former = owner.key();
            if former == key {
                continue;
            }
            *owner = Owner::new(key, next);
            if former.is_some() {
                if first + count != *slot {
                    sent += self.forget(queue, first, count);
                    (first, count) = (*slot, 0);
                }
                count += 1;
            }
        }
        sent + self.forget(queue, first, count)
    }

    /// Adds up what has arrived, by slot.
    fn take(&mut self, device: &wgpu::Device) -> Option<UsageCounts<'_>> {
        let Self { owners, sums, ring, .. } = self;
        sums.clear();
        sums.resize(owners.len(), 0);
        let mut total = 0;
        let has_any = ring.take(device, |collection, bytes| {
            // In browsers they need not be aligned to words.
            let counts = bytes.as_chunks().0.iter().map(|word| u32::from_ne_bytes(*word));
            for ((owner, sum), count) in owners.iter().zip(sums.iter_mut()).zip(counts).skip(1) {
                if count > 0 && owner.is_there_since(collection) {
                    total += u64::from(count);
                    *sum = sum.saturating_add(count);
                }
            }
        });
        has_any.then_some(UsageCounts { owners, sums, total })
    }
}

impl GpuLights {
    /// Counts one pick in `one_in` from the next upload on, chosen by a hash: in shaders that call `light_record_usage`
    /// (see [`GpuLights::usage_shader`]) and in [`GpuLights::sample`] and [`GpuLights::resample`], which count what
    /// they return. [`DEFAULT_USAGE_INTERVAL`] is a good number, 1 counts all, 0 (as at first) none; more than 2³¹ counts as that.
    ///
    /// Takes four bytes a slot for the counters, as many for each of up to three collections underway, and 20 on the
    /// CPU; our own kernels run one more dispatch each. Before the first call nothing is there and nothing is done.
    pub fn count_usage(&mut self, one_in: u32) {
        if one_in == 0 && self.picks.get().is_none() {
            return;
        }
        self.picks();
        let Some(picks) = self.picks.get_mut() else { return };
        // Who came and went meanwhile was not followed.
        picks.is_new |= picks.one_in == 0;
        picks.one_in = one_in.min(MAX_USAGE_INTERVAL);
        picks.send_thinning(&self.queue);
    }

    /// As [`GpuLights::shader`], with one function more:
    ///
    /// ```wgsl
    /// // Counts that a light of this instance was chosen, by these numbers.
    /// fn light_record_usage(instance: u32, u: vec4<f32>)
    /// ```
    ///
    /// Call it with the `instance` of a [`LightShader`] sample that you shade with, and the `u` that you gave for it: a
    /// hash of these says whether the call is counted, so each has the same chance, and no other work depends on it.
    /// Directional lights and "no light" count for nobody. Instances that are hit often make atomic additions queue up;
    /// that is what the share is for.
    ///
    /// The layout has a fifth storage buffer, which is written; it takes [`GpuLights::usage_bind_group`] in place of
    /// [`GpuLights::bind_group`]. In fragment shaders it needs `wgpu::DownlevelFlags::FRAGMENT_WRITABLE_STORAGE`, which
    /// all of WebGPU has. Before [`GpuLights::count_usage`] the function does nothing.
    pub fn usage_shader(&self, group: u32, effects: Effects) -> LightShader {
        let wgsl = text::wgsl_with_usage(group, effects);
        LightShader { wgsl, group, effects, records_usage: true, layout: self.picks().layout.clone() }
    }

    /// To be bound where a [`GpuLights::usage_shader`] was asked for; ask each frame, as for
    /// [`GpuLights::bind_group`].
    pub fn usage_bind_group(&self) -> &wgpu::BindGroup {
        &self.picks().bind_group
    }

    /// Records that what was counted so far goes back to the CPU, and that counting starts from zero: one copy and one
    /// fill of four bytes a slot. Call it once a frame, behind the passes that count. Nothing waits: the copy arrives
    /// when a later submission, or a poll of the engine's, finds it done. Three may be underway or not taken yet; with
    /// all in use nothing is recorded, and the counts go with a later call. An encoder that is dropped loses none.
    pub fn collect_usage(&mut self, encoder: &mut wgpu::CommandEncoder) {
        let Some(picks) = self.picks.get_mut() else { return };
        let bytes = 4 * picks.owners.len() as u64;
        // There is nobody yet, or no longer anyone who wants to know.
        if bytes <= 4 || picks.one_in == 0 || picks.is_new {
            return;
        }
        if picks.ring.record(&self.device, encoder, &picks.counts, bytes) {
            encoder.clear_buffer(&picks.counts, 4, Some(bytes - 4));
        }
    }

    /// All that has arrived of [`GpuLights::collect_usage`] since the last call, added up; `None` if nothing has. Never
    /// waits and never polls: wgpu notices arrivals in the engine's own `Queue::submit` and `Device::poll`. A lost
    /// device sends nothing. O(slots) where something has arrived, without allocation once the world has stopped growing.
    pub fn take_usage(&mut self) -> Option<UsageCounts<'_>> {
        self.picks.get_mut()?.take(&self.device)
    }

    /// Made when first needed.
    fn picks(&self) -> &UsageCounters {
        self.picks.get_or_init(|| UsageCounters::new(self))
    }

    /// Whether all slots are to be looked at.
    pub(super) fn has_new_usage(&self) -> bool {
        self.picks.get().is_some_and(|picks| picks.is_new && picks.one_in > 0)
    }

    /// Who has these slots now. Returns the bytes sent.
    pub(super) fn follow_usage(&mut self, slots: &BTreeSet<u32>, world: &LightWorld) -> u64 {
        self.picks.get_mut().map_or(0, |picks| picks.follow((&self.device, &self.queue), slots, world))
    }

    /// Binds again what was replaced.
    pub(super) fn bind_usage(&mut self) {
        let Some(mut picks) = self.picks.take() else { return };
        if picks.bound != self.bound || std::mem::take(&mut picks.is_unbound) {
            picks.bind_group = bind_group(&self.device, &picks.layout, &self.buffers(Some(&picks.counts)));
            picks.bound = self.bound;
        }
        self.picks = OnceLock::from(picks);
    }

    /// Counts what our own kernels chose, if anyone wants to know.
    pub(super) fn count_chosen(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        buffers: (&wgpu::Buffer, &wgpu::Buffer),
        chosen: Chosen,
        count: u32,
    ) {
        let Some(picks) = self.picks.get().filter(|picks| picks.one_in > 0) else { return };
        let kernel = picks.kernel.get_or_init(|| UsageKernel::new(&self.device, &picks.layout));
        kernel.record((&self.device, encoder), &picks.bind_group, buffers, chosen, count);
    }
}

/// Zeros for so many slots, or for twice as many as there were.
fn counters(device: &wgpu::Device, capacity: u32, slots: u32) -> wgpu::Buffer {
    let capacity = if slots > capacity { slots.max(capacity.saturating_mul(2)) } else { capacity };
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("girandole picks"),
        // Bound buffers hold at least a word, and this one the share.
        size: u64::from(capacity.max(64)) * 4,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

//! How often the lights of each instance are chosen: counted by shaders, and read back some frames
//! later without waiting.

mod counters;
mod kernel;
mod ring;

use std::sync::OnceLock;

pub use counters::UsageCounts;
pub(super) use counters::{UsageCounters, zeros};
pub(super) use kernel::RecordKind;
use kernel::UsageKernel;

use super::GpuLights;
use super::shader::LightShader;
use crate::effects::Effects;
use crate::plan::text;

/// One choice in sixteen: the recommended interval for [`GpuLights::count_usage`].
///
/// With one sample for each of two million pixels, some hundred thousand choices a frame are
/// counted. That is more than enough to tell which instances light the picture, and few enough not
/// to queue up at the counters.
pub const DEFAULT_USAGE_INTERVAL: u32 = 16;

impl GpuLights {
    /// Counts one choice in `interval`, selected by a hash, from the next upload on. Before the
    /// first call nothing is counted.
    ///
    /// Choices are counted where shaders call `light_record_usage` (see
    /// [`GpuLights::usage_shader`]), and for the records that [`GpuLights::sample`] and
    /// [`GpuLights::resample`] write. [`DEFAULT_USAGE_INTERVAL`] suits most engines; 1 counts every
    /// choice, and 0 stops counting. Intervals above 2³¹ act as 2³¹.
    ///
    /// Counting takes four bytes of GPU memory for each instance slot, as many again for each of up
    /// to three collections on their way back, and 20 bytes of CPU memory. Our own kernels run one
    /// more dispatch each.
    pub fn count_usage(&mut self, interval: u32) {
        if interval == 0 && self.usage.get().is_none() {
            return;
        }
        self.usage_counters();
        if let Some(usage) = self.usage.get_mut() {
            usage.set_interval(&self.queue, interval);
        }
    }

    /// As [`GpuLights::shader`], with one more function:
    ///
    /// ```wgsl
    /// // Records that a light of this instance was chosen with these random numbers.
    /// fn light_record_usage(instance: u32, u: vec4<f32>)
    /// ```
    ///
    /// Call it with the `instance` of a sample that you shade with, and with the `u` that you
    /// sampled with. A hash of `u` decides whether the call is counted, so every call has the same
    /// probability, and most calls end after the hash. Directional lights and "no light" may be
    /// passed and are never counted. Where many invocations choose the same instance their atomic
    /// additions queue up, which is what the interval is for.
    ///
    /// The layout has a fifth storage buffer, which is written. It takes
    /// [`GpuLights::usage_bind_group`] in place of [`GpuLights::bind_group`]. In fragment shaders
    /// it needs `wgpu::DownlevelFlags::FRAGMENT_WRITABLE_STORAGE`, which every WebGPU device has.
    /// Before [`GpuLights::count_usage`] the function does nothing.
    pub fn usage_shader(&self, group: u32, effects: Effects) -> LightShader {
        let wgsl = text::wgsl_of_shader(group, effects, text::Records::Usage, None);
        let layout = self.usage_counters().layout.clone();
        LightShader {
            wgsl,
            group,
            effects,
            records_usage: true,
            learns_visibility: false,
            target: None,
            previous_group: None,
            layout,
        }
    }

    /// The bind group for a [`GpuLights::usage_shader`]. Call this in each frame after
    /// [`GpuLights::upload`], as for [`GpuLights::bind_group`].
    pub fn usage_bind_group(&self) -> &wgpu::BindGroup {
        &self.usage_counters().bind_group
    }

    /// Records that the counts are copied for the CPU and start again from zero: one copy and one
    /// fill of four bytes for each instance slot. Call it once a frame, after the passes that
    /// count.
    ///
    /// Nothing waits: the copy arrives when a later submission or poll of the engine finds it done.
    /// Up to three copies may be under way or not taken yet. If all three are, or if the device has
    /// no memory for another, nothing is recorded and the counts go with a later call. An encoder
    /// that is dropped unsubmitted loses no counts.
    pub fn collect_usage(&mut self, encoder: &mut wgpu::CommandEncoder) {
        if let Some(usage) = self.usage.get_mut() {
            usage.collect(&self.device, encoder);
        }
    }

    /// Returns the sum of all collections that have arrived since the last call; `None` if none
    /// has.
    ///
    /// Never waits and never polls: wgpu notices arrivals during the engine's own `Queue::submit`
    /// and `Device::poll`. Nothing arrives from a lost device. O(slots) if something has arrived,
    /// and without allocation once the world has stopped growing.
    #[must_use]
    pub fn take_usage(&mut self) -> Option<UsageCounts<'_>> {
        self.usage.get_mut()?.take(&self.device)
    }

    /// Makes the counters when they are first needed. They count nothing before the first upload
    /// after [`GpuLights::count_usage`], which replaces the buffer.
    fn usage_counters(&self) -> &UsageCounters {
        self.usage.get_or_init(|| UsageCounters::new(&self.device, self.no_usage.clone(), &self.buffers()))
    }

    /// Replaces the bind group with the counters if a buffer of it was replaced.
    pub(super) fn rebind_usage(&mut self) {
        let Some(mut usage) = self.usage.take() else { return };
        usage.rebind(&self.device, &self.buffers(), self.bound);
        self.usage = OnceLock::from(usage);
    }

    /// Records the usage of what one of our own kernels chose, if usage is counted.
    pub(super) fn record_usage_of(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        buffers: (&wgpu::Buffer, &wgpu::Buffer),
        kind: RecordKind,
        count: u32,
    ) {
        let Some(usage) = self.usage.get().filter(|usage| usage.is_counting()) else { return };
        let kernel = usage.kernel.get_or_init(|| UsageKernel::new(&self.device, &usage.layout));
        kernel.record((&self.device, encoder), &usage.bind_group, buffers, kind, count);
    }
}

//! Records the kernel that keeps one of several candidates for each shading point of a buffer.

use super::GpuLights;
use super::bindings::records;
use super::records::{SampleRecord, SampleRequest};
use crate::sampling::counts::CandidateCount;

impl GpuLights {
    /// Records a pass that draws `candidates` lights for each of the first `count` requests and
    /// keeps one, as [`LightSampler::resample`](crate::LightSampler::resample) does.
    ///
    /// `requests` holds [`SampleRequest`]s; the pass writes [`SampleRecord`]s to `samples`, in which
    /// `1 / weight` of the [`Reservoir`](crate::Reservoir) takes the place of the pmf.
    /// Both are storage buffers of the engine with room for `count` records.
    ///
    /// The top level must have been built since the last upload: see [`GpuLights::build_top`].
    /// Pipelines are made as by [`GpuLights::sample`]. Each call makes a bind group.
    pub fn resample(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        requests: &wgpu::Buffer,
        samples: &wgpu::Buffer,
        count: u32,
        candidates: CandidateCount,
    ) {
        if count == 0 {
            return;
        }
        let pipeline = self.resampling.pipeline(self.effects());
        let own = [
            records(requests, count, size_of::<SampleRequest>()),
            records(samples, count, size_of::<SampleRecord>()),
            self.candidates.binding(candidates),
        ];
        self.resampling.record(encoder, &pipeline, &self.kernel_group(), &own, count);
    }
}

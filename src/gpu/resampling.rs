//! Our own kernel that keeps one of several candidates for each shading point of a buffer.

use bytemuck::{Pod, Zeroable};

use super::kernel::{Kernel, records};
use super::sampling::{SampleRecord, SampleRequest};
use super::usage::Chosen;
use super::{GpuLights, storage_entry};
use crate::counts::CandidateCount;

/// The candidate that was kept and its weight. 64 bytes; `LightReservoir` in `shaders/resample.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ReservoirRecord {
    /// The candidate, with its own pmf and pdf.
    pub chosen: SampleRecord,
    /// In place of `1 / (pmf * pdf)`; 0 if no candidate brings anything. See [`Reservoir`](crate::Reservoir).
    pub weight: f32,
    /// Nothing.
    pub padding: [f32; 3],
}

/// Compiles nothing.
pub(super) fn kernel(device: &wgpu::Device, lights: &wgpu::BindGroupLayout) -> Kernel {
    let candidates = wgpu::BindGroupLayoutEntry {
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        ..storage_entry(2, true)
    };
    let entries = [storage_entry(0, true), storage_entry(1, false), candidates];
    Kernel::new(device, lights, "batch_resample", include_str!("../../shaders/batch_resample.wgsl"), &entries)
}

impl GpuLights {
    /// Keeps one of `candidates` for each of `requests` (an array of
    /// [`SampleRequest`]), as [`LightSampler::resample`](crate::LightSampler::resample) does, and writes it to `samples` (of
    /// [`ReservoirRecord`]); both are storage buffers of the engine with room for `count` records. Records into the
    /// engine's encoder.
    ///
    /// The top level must have been built after the last upload. Pipelines are made as by [`GpuLights::sample`]; each
    /// call makes a bind group and a buffer of 16 bytes.
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
        let pipeline = self.resampling.pipeline(self.effects);
        let uniform = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("girandole candidates"),
            size: 16,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&uniform, 0, bytemuck::bytes_of(&[candidates.get(), 0, 0, 0]));
        let own = [
            records::<SampleRequest>(requests, count),
            records::<ReservoirRecord>(samples, count),
            uniform.as_entire_binding(),
        ];
        self.resampling.record(encoder, &pipeline, &self.bind_group, &own, count);
        self.count_chosen(encoder, (requests, samples), Chosen::Reservoir, count);
    }
}

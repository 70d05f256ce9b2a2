//! A kernel that counts the nodes that each sample reads.

use super::super::bindings::{bind, records, storage_entry, uniform_entry};
use super::super::kernel::{BATCH_COUNT, LANES};
use super::super::records::SampleRequest;
use super::super::{GpuLights, player};
use crate::effects::Effects;
use crate::plan::text;
use crate::sampling::counts::CandidateCount;

/// Counts the nodes that each sample reads.
#[derive(Debug)]
pub struct NodeCounter {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl NodeCounter {
    /// Compiles the pipeline, for all effects.
    pub fn new(lights: &GpuLights) -> Self {
        let device = &lights.device;
        let label = Some("girandole count");
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Wgsl((text::wgsl_counting(0, Effects::all()) + BATCH_COUNT).into()),
        });
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label,
            entries: &[storage_entry(0, true), storage_entry(1, false), uniform_entry(2)],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&lights.kernel_layout), Some(&layout)],
            ..Default::default()
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some("batch_count"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        Self { pipeline, layout }
    }

    /// Counts the nodes of both levels that each sample reads. Does the work of
    /// [`GpuLights::resample`], which for one candidate is that of [`GpuLights::sample`], but
    /// writes to `counts` a `u32` for each request instead of a sample. A node that is read twice
    /// counts twice.
    ///
    /// `requests` is an array of [`SampleRequest`]; both buffers have room for `count` records. The
    /// top level must have been built after the last upload. Each call makes a bind group and a buffer
    /// of 16 bytes.
    pub fn record(
        &self,
        lights: &GpuLights,
        encoder: &mut wgpu::CommandEncoder,
        (requests, counts): (&wgpu::Buffer, &wgpu::Buffer),
        count: u32,
        candidates: CandidateCount,
    ) {
        if count == 0 {
            return;
        }
        let resources = [
            records(requests, count, size_of::<SampleRequest>()),
            records(counts, count, size_of::<u32>()),
            lights.candidates.binding(candidates),
        ];
        let group = bind(&lights.device, "girandole count", &self.layout, &resources);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("girandole count"),
            timestamp_writes: None,
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &lights.kernel_group(), &[]);
        pass.set_bind_group(1, &group, &[]);
        player::dispatch(&mut pass, count.div_ceil(LANES));
    }
}

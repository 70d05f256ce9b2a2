//! A kernel that counts the nodes that each sample reads.

use super::super::bindings::{bind, records, storage_entry, uniform_entry};
use super::super::kernel::{BATCH_COUNT, LANES};
use super::super::records::SampleRequest;
use super::super::{GpuLights, player};
use crate::effects::Effects;
use crate::plan::text;
use crate::sampling::counts::CandidateCount;

/// The pipeline of `shaders/batch_count.wgsl`.
#[derive(Debug)]
pub(in crate::gpu) struct CountKernel {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl CountKernel {
    fn new(device: &wgpu::Device, lights: &wgpu::BindGroupLayout) -> Self {
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
            bind_group_layouts: &[Some(lights), Some(&layout)],
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
}

impl GpuLights {
    /// Counts the nodes of both levels that each sample reads. Does the work of
    /// [`GpuLights::resample`], which for one candidate is that of [`GpuLights::sample`], but
    /// writes to `counts` a `u32` for each request instead of a sample. A node that is read twice
    /// counts twice.
    ///
    /// `requests` is an array of [`SampleRequest`]; both buffers have room for `count` records. The
    /// top level must have been built after the last upload. The first call compiles the pipeline;
    /// each call makes a bind group and a buffer of 16 bytes.
    pub fn count_nodes(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        requests: &wgpu::Buffer,
        counts: &wgpu::Buffer,
        count: u32,
        candidates: CandidateCount,
    ) {
        if count == 0 {
            return;
        }
        let kernel = self.node_counter.get_or_init(|| CountKernel::new(&self.device, &self.layout));
        let resources = [
            records(requests, count, size_of::<SampleRequest>()),
            records(counts, count, size_of::<u32>()),
            self.candidates.binding(candidates),
        ];
        let group = bind(&self.device, "girandole count", &kernel.layout, &resources);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("girandole count"),
            timestamp_writes: None,
        });
        pass.set_pipeline(&kernel.pipeline);
        pass.set_bind_group(0, &self.bind_group, &[]);
        pass.set_bind_group(1, &group, &[]);
        player::dispatch(&mut pass, count.div_ceil(LANES));
    }
}

//! A kernel that counts the nodes that samples read.

use super::super::bindings::{bind, records, storage_entry, uniform_entry};
use super::super::kernel::LANES;
use super::super::records::SampleRequest;
use super::super::stages;
use super::super::{GpuLights, text};
use crate::counts::CandidateCount;
use crate::effects::Effects;

pub(in crate::gpu) struct CountKernel {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl CountKernel {
    fn new(device: &wgpu::Device, lights: &wgpu::BindGroupLayout) -> Self {
        let label = Some("girandole count");
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Wgsl((text::wgsl_counting(0, Effects::all()) + text::BATCH_COUNT).into()),
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
    /// Counts the nodes of both levels that a sample reads: does what [`GpuLights::resample`] does, which for one
    /// candidate is [`GpuLights::sample`], and writes a `u32` for each request to `counts` instead of the samples. A
    /// node that is read twice counts twice.
    ///
    /// The top level must have been built after the last upload. The first call makes the pipeline.
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
        stages::dispatch(&mut pass, count.div_ceil(LANES));
    }
}

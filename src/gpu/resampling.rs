//! Our own kernel that keeps one of several candidates for each receiver of a buffer.

use bytemuck::{Pod, Zeroable};

use super::sampling::{LANES, ROW, SampleRecord, SampleRequest};
use super::{GpuLights, storage_entry, text};
use crate::effects::Effects;

/// The candidate that was kept and its weight. 64 bytes; `LightResampled` in `shaders/resample.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ResampledRecord {
    /// The candidate, with its own pmf and pdf.
    pub sample: SampleRecord,
    /// In place of `1 / (pmf * pdf)`; 0 if no candidate brings anything. See [`Resampled`](crate::Resampled).
    pub weight: f32,
    /// Nothing.
    pub padding: [f32; 3],
}

pub(super) struct ResampleKernel {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl ResampleKernel {
    fn new(device: &wgpu::Device, lights: &wgpu::BindGroupLayout) -> Self {
        let label = Some("girandole resample");
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Wgsl(
                (text::wgsl(0, Effects::all()) + include_str!("../../shaders/batch_resample.wgsl")).into(),
            ),
        });
        let candidates = wgpu::BindGroupLayoutEntry {
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            ..storage_entry(2, true)
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label,
            entries: &[storage_entry(0, true), storage_entry(1, false), candidates],
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
            entry_point: Some("batch_resample"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        Self { pipeline, layout }
    }
}

impl GpuLights {
    /// Keeps one of `candidates` (1 to [`MOST_CANDIDATES`](crate::MOST_CANDIDATES)) for each of `requests` (an array of
    /// [`SampleRequest`]), as [`Sampler::resample`](crate::Sampler::resample) does, and writes it to `samples` (of
    /// [`ResampledRecord`]); both are storage buffers of the engine with room for `count` records. Records into the
    /// engine's encoder.
    ///
    /// The top level must have been built after the last upload. The first call makes the pipeline; each makes a bind
    /// group and a buffer of 16 bytes.
    pub fn resample(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        requests: &wgpu::Buffer,
        samples: &wgpu::Buffer,
        count: u32,
        candidates: u32,
    ) {
        if count == 0 {
            return;
        }
        let kernel = self.resampling.get_or_init(|| ResampleKernel::new(&self.device, &self.layout));
        let uniform = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("girandole candidates"),
            size: 16,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&uniform, 0, bytemuck::bytes_of(&[candidates, 0, 0, 0]));
        let binding = |buffer, stride: usize| {
            wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer,
                offset: 0,
                size: std::num::NonZeroU64::new(u64::from(count) * stride as u64),
            })
        };
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("girandole resample"),
            layout: &kernel.layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: binding(requests, size_of::<SampleRequest>()) },
                wgpu::BindGroupEntry { binding: 1, resource: binding(samples, size_of::<ResampledRecord>()) },
                wgpu::BindGroupEntry { binding: 2, resource: uniform.as_entire_binding() },
            ],
        });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("girandole resample"),
            timestamp_writes: None,
        });
        pass.set_pipeline(&kernel.pipeline);
        pass.set_bind_group(0, &self.bind_group, &[]);
        pass.set_bind_group(1, &group, &[]);
        let groups = count.div_ceil(LANES);
        pass.dispatch_workgroups(groups.min(ROW), groups.div_ceil(ROW), 1);
    }
}

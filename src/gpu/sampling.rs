//! Our own kernel over a buffer of receivers, for those who want no shader.

use bytemuck::{Pod, Zeroable};

use super::{GpuLights, text};

/// Invocations of a workgroup.
const LANES: u32 = 64;
/// Workgroups along one dimension, as WebGPU allows.
const ROW: u32 = 65535;

/// A receiver and its four random numbers in [0, 1). 48 bytes; `Request` in `shaders/batch.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SampleRequest {
    /// Metres, relative to the world's origin.
    pub position: [f32; 3],
    /// Not read.
    pub padding_a: u32,
    /// Unit normal, or zero for a point in a volume.
    pub normal: [f32; 3],
    /// Not read.
    pub padding_b: u32,
    /// Two numbers choose the light, two the point on it.
    pub u: [f32; 4],
}

/// A chosen light and a point on it. 48 bytes; `LightSample` in `shaders/sample.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SampleRecord {
    /// Unit vector from the receiver to the light.
    pub direction: [f32; 3],
    /// Metres; at least 1e18 for a directional light.
    pub distance: f32,
    /// Nits for surfaces, lux for lights without size.
    pub radiance: [f32; 3],
    /// Per steradian for surfaces, 1 for lights without size.
    pub pdf: f32,
    /// The light's chance; 0 for no light.
    pub pmf: f32,
    /// The instance's slot, see [`World::instance_at`](crate::World::instance_at); `u32::MAX` for a directional light.
    pub instance: u32,
    /// Its index in the tree, or among the directional lights.
    pub light: u32,
    /// 1 for a light without size.
    pub is_delta: u32,
}

pub(super) struct BatchKernel {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl BatchKernel {
    pub fn new(device: &wgpu::Device, lights: &wgpu::BindGroupLayout) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("girandole batch"),
            source: wgpu::ShaderSource::Wgsl(
                (text::wgsl(0, crate::effects::Effects::all()) + include_str!("../../shaders/batch.wgsl")).into(),
            ),
        });
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("girandole batch"),
            entries: &[super::storage_entry(0, true), super::storage_entry(1, false)],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("girandole batch"),
            bind_group_layouts: &[Some(lights), Some(&layout)],
            ..Default::default()
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("girandole batch"),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some("batch"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        Self { pipeline, layout }
    }
}

impl GpuLights {
    /// Samples one light for each of `requests` (an array of [`SampleRequest`]) into `samples` (of [`SampleRecord`]),
    /// both storage buffers of the engine with room for `count` records. Records into the engine's encoder.
    ///
    /// The top level must have been built after the last upload.
    pub fn sample(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        requests: &wgpu::Buffer,
        samples: &wgpu::Buffer,
        count: u32,
    ) {
        if count == 0 {
            return;
        }
        let binding = |buffer, stride: usize| {
            wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer,
                offset: 0,
                size: std::num::NonZeroU64::new(u64::from(count) * stride as u64),
            })
        };
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("girandole batch"),
            layout: &self.batch.layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: binding(requests, size_of::<SampleRequest>()) },
                wgpu::BindGroupEntry { binding: 1, resource: binding(samples, size_of::<SampleRecord>()) },
            ],
        });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("girandole sample"),
            timestamp_writes: None,
        });
        pass.set_pipeline(&self.batch.pipeline);
        pass.set_bind_group(0, &self.bind_group, &[]);
        pass.set_bind_group(1, &group, &[]);
        let groups = count.div_ceil(LANES);
        pass.dispatch_workgroups(groups.min(ROW), groups.div_ceil(ROW), 1);
    }
}

//! A compute shader that chooses one light for each shading point of a buffer, as one of an engine would.
//!
//! Knows no type of the library, so the library's own tests use it too.

use bytemuck::{Pod, Zeroable};

/// A shading point and its random numbers; `Request` in `request.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SampleRequest {
    /// Metres, relative to the origin of the world.
    pub position: [f32; 3],
    /// Not read.
    pub padding: u32,
    /// The unit normal of a surface, or zero for a point in a volume.
    pub normal: [f32; 3],
    /// Not read.
    pub padding_after_normal: u32,
    /// Random numbers in [0, 1). The first two choose the light, the last two the point on it.
    pub u: [f32; 4],
}

/// What `light_sample` returns; `LightSample` in the library's `shaders/sample.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SampleRecord {
    /// Unit vector from the shading point to the light.
    pub direction: [f32; 3],
    /// Distance to the light in metres; at least 1e18 for a directional light.
    pub dist: f32,
    /// Radiance in nits for a surface. For a light without size, the illuminance in lux of a
    /// surface that faces it.
    pub radiance: [f32; 3],
    /// Density per steradian for a surface, seen from the shading point; 1 for a light without
    /// size.
    pub pdf: f32,
    /// Probability of the light among all lights, in [0, 1]; 0 for a sample that counts as black.
    pub pmf: f32,
    /// Slot of the light's instance; `u32::MAX` for a directional light.
    pub instance: u32,
    /// Index of the light in its tree, or in the list of directional lights.
    pub light: u32,
    /// 1 for a light without size: a point, a spot or a directional light. Otherwise 0.
    pub is_delta: u32,
}

/// The shader, which goes behind a text of the library for group 0, with the record that it reads.
pub const STAGE: &str = concat!(include_str!("request.wgsl"), include_str!("batch.wgsl"));

/// Invocations of a workgroup.
const LANES: u32 = 64;

/// The layout of two storage buffers: one that a shader reads, and one that it writes.
pub fn in_and_out(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding, read_only| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    };
    let entries = &[entry(0, true), entry(1, false)];
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("in and out"), entries })
}

/// The pipeline for a joined text and the layout of group 0.
pub fn pipeline(device: &wgpu::Device, text: &str, lights: &wgpu::BindGroupLayout) -> wgpu::ComputePipeline {
    let label = Some("batch");
    let own = in_and_out(device);
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: &[Some(lights), Some(&own)],
        ..Default::default()
    });
    let source = wgpu::ShaderSource::Wgsl(text.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label, source });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label,
        layout: Some(&layout),
        module: &module,
        entry_point: label,
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

/// Records the choice of a light for each of the first `count` requests. `buffers` are those of requests and samples.
pub fn record(
    device: &wgpu::Device,
    encoder: &mut wgpu::CommandEncoder,
    pipeline: &wgpu::ComputePipeline,
    lights: &wgpu::BindGroup,
    buffers: [&wgpu::Buffer; 2],
    count: u32,
) {
    let entries =
        [0, 1].map(|i: u32| wgpu::BindGroupEntry { binding: i, resource: buffers[i as usize].as_entire_binding() });
    let layout = &pipeline.get_bind_group_layout(1);
    let group =
        device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("batch"), layout, entries: &entries });
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, lights, &[]);
    pass.set_bind_group(1, &group, &[]);
    let groups = count.div_ceil(LANES);
    let x = groups.clamp(1, wgpu::Limits::default().max_compute_workgroups_per_dimension);
    pass.dispatch_workgroups(x, groups.div_ceil(x), 1);
}

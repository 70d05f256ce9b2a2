//! A kernel that writes the lights of a buffer, and the frames of an engine around it.

use bytemuck::{Pod, Zeroable};
use girandole::glam::Vec3;
use girandole::gpu::{GpuError, GpuLights};
use girandole::light::Shape;
use girandole::{Light, LightWorld, TreeKey};
use testbed::scene::SceneError;
use wgpu::util::DeviceExt;

/// A point, or a triangle, or a light that is dark.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Put {
    a: [f32; 3],
    source: u32,
    b: [f32; 3],
    light: u32,
    c: [f32; 3],
    /// 0 for a point, 1 for a triangle, 2 for a dark light, and 4 more for a light that was born.
    what: u32,
    emission: [f32; 3],
    padding: u32,
}

const KERNEL: &str = "
struct Put {
    a: vec3<f32>,
    source: u32,
    b: vec3<f32>,
    light: u32,
    c: vec3<f32>,
    what: u32,
    emission: vec3<f32>,
}

@group(0) @binding(0) var<storage, read> puts: array<Put>;

@compute @workgroup_size(64)
fn write_lights(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = id.y * 64u * groups.x + id.x;
    if index >= arrayLength(&puts) {
        return;
    }
    let put = puts[index];
    if (put.what & 4u) != 0u {
        light_put_new(put.source, put.light);
    }
    switch put.what & 3u {
        case 0u: { light_put_point(put.source, put.light, put.a, put.emission); }
        case 1u: { light_put_triangle(put.source, put.light, put.a, put.b, put.c, put.emission); }
        default: { light_put_dark(put.source, put.light); }
    }
}
";

impl Put {
    /// What writes a light of a source. Kinds besides points and triangles are made dark.
    pub fn of(source: u32, light: u32, value: &Light) -> Self {
        let (what, [a, b, c]) = match value.shape {
            _ if value.flux() <= 0.0 => (2, [Vec3::ZERO; 3]),
            Shape::Point { position } => (0, [position, Vec3::ZERO, Vec3::ZERO]),
            Shape::Triangle { vertices, .. } => (1, vertices),
            _ => (2, [Vec3::ZERO; 3]),
        };
        let [a, b, c] = [a, b, c].map(|v| v.to_array());
        Self { a, source, b, light, c, what, emission: value.emission.to_array(), padding: 0 }
    }

    /// The same, for a light that is another one from now on if it was born.
    pub fn born_if(self, is_born: bool) -> Self {
        Self { what: self.what | if is_born { 4 } else { 0 }, ..self }
    }
}

/// Runs the kernel.
pub struct Writer {
    device: wgpu::Device,
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

impl Writer {
    pub fn new(device: &wgpu::Device, lights: &GpuLights) -> Self {
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("lights to write"),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Storage { read_only: true },
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            }],
        });
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("write_lights"),
            source: wgpu::ShaderSource::Wgsl((lights.source_shader(1) + KERNEL).into()),
        });
        let layouts = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            bind_group_layouts: &[Some(&layout), Some(lights.source_layout())],
            ..Default::default()
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("write_lights"),
            layout: Some(&layouts),
            module: &module,
            entry_point: Some("write_lights"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        Self { device: device.clone(), layout, pipeline }
    }

    /// Records the writes into an encoder, between the upload and the build of the top level.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, lights: &mut GpuLights, puts: &[Put]) {
        let Some(sources) = lights.source_group() else { return };
        let buffer = self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("lights to write"),
            contents: bytemuck::cast_slice(puts),
            usage: wgpu::BufferUsages::STORAGE,
        });
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }],
        });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.set_bind_group(1, sources, &[]);
        let groups = (puts.len() as u32).div_ceil(64);
        let x = groups.min(32_768);
        pass.dispatch_workgroups(x.max(1), groups.div_ceil(x.max(1)), 1);
    }
}

/// What writes all lights of a tree with a source.
pub fn puts(world: &LightWorld, tree: TreeKey, lights: &[Light]) -> Vec<Put> {
    let Some((_, source)) = world.light_source(tree) else { return Vec::new() };
    (0..).zip(lights).map(|(index, light)| Put::of(source, index, light)).collect()
}

/// One line for a refusal of the device.
pub fn refused(error: GpuError) -> SceneError {
    SceneError(format!("the device refuses the lights: {error}"))
}

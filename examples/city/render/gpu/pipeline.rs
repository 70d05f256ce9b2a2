//! The render shader, joined with the library's text, and its pipeline.

use super::geometry::Geometry;
use super::texels::TEXEL_ROW;
use girandole::gpu::LightShader;
use girandole::wgpu;

/// The bind group of the library's text.
pub const LIGHT_GROUP: u32 = 1;
/// Invocations along each side of a workgroup.
pub const WORKGROUP: u32 = 8;

/// The text of the shader. `light` is the library's text. `records_usage` is whether the shader
/// counts the lights that it samples.
pub fn shader_source(light: &str, records_usage: bool, stack_size: usize) -> String {
    let body = if records_usage { "light_record_usage(instance, u);" } else { "" };
    format!(
        "{light}\nconst STACK_SIZE: u32 = {stack_size}u;\nconst TEXEL_ROW: u32 = {TEXEL_ROW}u;\n\
         fn record_usage(instance: u32, u: vec4<f32>) {{ {body} }}\n{}\n{}",
        include_str!("textures.wgsl"),
        include_str!("render.wgsl")
    )
}

/// The size of the traversal stack, rounded up so that a slightly deeper upper hierarchy needs no
/// other shader.
pub fn stack_size(geometry: &Geometry) -> usize {
    (geometry.stack_size() + 4).next_multiple_of(16)
}

/// Compiles the pipeline.
pub fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    shader: &LightShader,
    stack_size: usize,
) -> wgpu::ComputePipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("city render"),
        source: wgpu::ShaderSource::Wgsl(shader_source(&shader.wgsl, shader.records_usage, stack_size).into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("city render"),
        bind_group_layouts: &[Some(layout), Some(&shader.layout)],
        ..Default::default()
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("city render"),
        layout: Some(&layout),
        module: &module,
        entry_point: Some("render"),
        compilation_options: Default::default(),
        cache: None,
    })
}

//! What shaders bind that mark cells, and that choose from their cuts.

use super::super::bindings::{bind, bind_lights, cut_layout, mark_layout};
use crate::plan::{BufferId, ShaderBuffers};

/// The buffers of lights and of the table; `None` in place of zeros.
pub(in crate::gpu) type Bound = (Option<ShaderBuffers>, Option<BufferId>);

/// The bind groups with their layouts.
pub(in crate::gpu) struct CutBindings {
    pub layout: wgpu::BindGroupLayout,
    pub bind_group: wgpu::BindGroup,
    pub mark_layout: wgpu::BindGroupLayout,
    pub mark_bind_group: wgpu::BindGroup,
    /// What the bind groups were made for.
    bound: Bound,
}

impl CutBindings {
    pub fn new(device: &wgpu::Device, lights: &[&wgpu::Buffer], table: &wgpu::Buffer, bound: Bound) -> Self {
        let (layout, mark_layout) = (cut_layout(device), mark_layout(device));
        let [bind_group, mark_bind_group] = groups(device, [&layout, &mark_layout], lights, table);
        Self { layout, bind_group, mark_layout, mark_bind_group, bound }
    }

    /// Replaces the bind groups if a buffer was replaced.
    pub fn rebind(&mut self, device: &wgpu::Device, lights: &[&wgpu::Buffer], table: &wgpu::Buffer, bound: Bound) {
        if self.bound != bound {
            [self.bind_group, self.mark_bind_group] = groups(device, [&self.layout, &self.mark_layout], lights, table);
            self.bound = bound;
        }
    }
}

fn groups(
    device: &wgpu::Device,
    [layout, mark_layout]: [&wgpu::BindGroupLayout; 2],
    lights: &[&wgpu::Buffer],
    table: &wgpu::Buffer,
) -> [wgpu::BindGroup; 2] {
    let all: Vec<_> = lights.iter().copied().chain([table]).collect();
    let marks = bind(device, "girandole marks", mark_layout, &[table.as_entire_binding()]);
    [bind_lights(device, layout, &all), marks]
}

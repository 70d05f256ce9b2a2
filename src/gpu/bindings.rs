//! Bind group layouts and bind groups of what shaders of an engine bind.

/// The stages that may read the lights.
const VISIBILITY: wgpu::ShaderStages = wgpu::ShaderStages::COMPUTE.union(wgpu::ShaderStages::FRAGMENT);

/// The buffers that shaders bind: parameters, top level, nodes, instances, lights, cuts, marks, the last frame.
pub(super) const ALL: usize = 8;
/// The place of the marks among them.
const MARKS: usize = 6;

/// The layout of the first `count` buffers that shaders bind: all, or without the last frame. `fragments_write` is as
/// in [`GpuOptions`](super::GpuOptions).
pub(super) fn light_layout(device: &wgpu::Device, count: usize, fragments_write: bool) -> wgpu::BindGroupLayout {
    let written = if fragments_write { VISIBILITY } else { wgpu::ShaderStages::COMPUTE };
    let mut entries = vec![uniform_entry(0)];
    entries.extend((1..count as u32).map(|binding| storage_entry(binding, true)));
    if let Some(marks) = entries.get_mut(MARKS) {
        *marks = entry(marks.binding, written, wgpu::BufferBindingType::Storage { read_only: false });
    }
    let label = Some("girandole lights");
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries })
}

/// The name of a thing of the library in graphics debuggers, among those of the engine.
pub(super) fn label_of(what: &str) -> String {
    format!("girandole {what}")
}

/// A uniform buffer for any stage.
fn uniform_entry(binding: u32) -> wgpu::BindGroupLayoutEntry {
    entry(binding, VISIBILITY, wgpu::BufferBindingType::Uniform)
}

/// A storage buffer: for any stage if it is only read, else for compute shaders.
pub(super) fn storage_entry(binding: u32, read_only: bool) -> wgpu::BindGroupLayoutEntry {
    let visibility = if read_only { VISIBILITY } else { wgpu::ShaderStages::COMPUTE };
    entry(binding, visibility, wgpu::BufferBindingType::Storage { read_only })
}

fn entry(binding: u32, visibility: wgpu::ShaderStages, ty: wgpu::BufferBindingType) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None }
}

/// Binds whole buffers, in the order of the layout.
pub(super) fn bind(
    device: &wgpu::Device,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    buffers: &[&wgpu::Buffer],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
}

//! Devices for the library's own GPU tests: one that they share, with WebGPU's default limits and no
//! features, and others for tests that need more or less.

use std::sync::OnceLock;

/// The shared device and its queue, made once for each process.
///
/// Panics if there is no adapter: a GPU test never passes without running.
pub(crate) fn gpu() -> (wgpu::Device, wgpu::Queue) {
    static GPU: OnceLock<(wgpu::Device, wgpu::Queue)> = OnceLock::new();
    GPU.get_or_init(|| limited_gpu(&wgpu::Limits::default(), wgpu::Features::empty())).clone()
}

/// A new device with these limits and features.
pub(crate) fn limited_gpu(limits: &wgpu::Limits, features: wgpu::Features) -> (wgpu::Device, wgpu::Queue) {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::PRIMARY,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapter =
        pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())).unwrap_or_else(|e| {
            panic!(
                "the GPU tests found no adapter ({e}). A software one does: run scripts/test.sh, \
                 or on Debian and Ubuntu: apt install mesa-vulkan-drivers libvulkan1"
            )
        });
    let descriptor = wgpu::DeviceDescriptor {
        required_limits: limits.clone(),
        required_features: features,
        ..wgpu::DeviceDescriptor::default()
    };
    pollster::block_on(adapter.request_device(&descriptor)).expect("no more than the adapter has")
}

/// A device of wgpu's `noop` backend, which checks commands but runs none.
pub(crate) fn noop() -> (wgpu::Device, wgpu::Queue) {
    wgpu::Device::noop(&wgpu::DeviceDescriptor::default())
}

/// The content of a buffer with `COPY_SRC` after all work that was submitted so far.
pub(crate) fn read<T: bytemuck::Pod>(device: &wgpu::Device, queue: &wgpu::Queue, buffer: &wgpu::Buffer) -> Vec<T> {
    let copy = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("test read-back"),
        size: buffer.size(),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, buffer.size());
    let submitted = queue.submit([encoder.finish()]);
    copy.map_async(wgpu::MapMode::Read, .., |done| done.expect("the buffer maps"));
    device
        .poll(wgpu::PollType::Wait { submission_index: Some(submitted), timeout: None })
        .expect("the device finishes its work");
    let bytes = copy.get_mapped_range(..).expect("the buffer is mapped");
    bytemuck::pod_collect_to_vec(&bytes)
}

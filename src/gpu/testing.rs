//! Devices for the library's own GPU tests: one that they share, with WebGPU's default limits and
//! no features, and others for tests that need more or less.

use std::sync::OnceLock;

/// The code that examples, tests and benches open devices with.
#[path = "../../examples/common/gpu.rs"]
#[allow(dead_code, reason = "examples use more of it")]
mod shared;

/// The shared device and its queue, made once for each process.
///
/// Panics if there is no adapter: a GPU test never passes without running.
pub(crate) fn gpu() -> (wgpu::Device, wgpu::Queue) {
    static GPU: OnceLock<(wgpu::Device, wgpu::Queue)> = OnceLock::new();
    GPU.get_or_init(|| limited_gpu(&wgpu::Limits::default(), wgpu::Features::empty())).clone()
}

/// A new device with these limits and features.
pub(crate) fn limited_gpu(limits: &wgpu::Limits, features: wgpu::Features) -> (wgpu::Device, wgpu::Queue) {
    let opened = shared::find_adapter(None)
        .map_err(|error| format!("{error}; run scripts/test.sh, or {}", shared::HOW_TO_GET_AN_ADAPTER))
        .and_then(|adapter| shared::open_device(&adapter, features, limits.clone()));
    opened.unwrap_or_else(|error| panic!("GPU tests need an adapter: {error}"))
}

/// A device of wgpu's `noop` backend, which checks commands but runs none.
pub(crate) fn noop() -> (wgpu::Device, wgpu::Queue) {
    wgpu::Device::noop(&wgpu::DeviceDescriptor::default())
}

/// The content of a buffer with `COPY_SRC` after all work that was submitted so far.
pub(crate) fn read<T: bytemuck::Pod>(device: &wgpu::Device, queue: &wgpu::Queue, buffer: &wgpu::Buffer) -> Vec<T> {
    shared::read(device, queue, buffer).expect("the device finishes its work and the buffer maps")
}

//! Devices for the library's own GPU tests: one that they share, with WebGPU's default limits and
//! no features, and others for tests that need more or less.

use std::sync::OnceLock;

use glam::Vec3;
use testbed::common::gpu as shared;

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

/// A number in [0, 1) for each index and purpose; the same every time.
pub(crate) fn random(index: u32, salt: u32) -> f32 {
    let mix = (u64::from(index) << 32 | u64::from(salt)).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mix = (mix ^ (mix >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mix >> 40) as f32 / (1u64 << 24) as f32
}

/// A vector with coordinates in [-0.5, 0.5) for each index and purpose.
pub(crate) fn random_vec(index: u32, salt: u32) -> Vec3 {
    Vec3::new(random(index, salt), random(index, salt + 1), random(index, salt + 2)) - Vec3::splat(0.5)
}

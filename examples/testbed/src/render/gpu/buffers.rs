//! The buffers of the renderer: those that the shader reads, and those that are read back.

use super::backend::Gpu;
use super::geometry::Geometry;
use super::scene::{Scene, SceneError};
use super::scene_buffers::SceneBuffers;
use girandole::wgpu;

/// Bytes of a pixel: its sums of radiance, and its numbers of shadow rays.
const PIXEL_BYTES: u64 = 32;
/// Bytes of what a pixel keeps: `Kept` in `reuse.wgsl`.
const KEPT_BYTES: u64 = 80;

/// All buffers of the renderer.
pub struct Buffers {
    /// What the shader reads.
    pub scene: SceneBuffers,
    /// The pixels of a band.
    pub image: wgpu::Buffer,
    /// What the pixels of two frames keep, if they keep anything.
    pub kept: Option<wgpu::Buffer>,
}

impl Buffers {
    /// Allocates the buffers and uploads the geometry. Refuses a scene that exceeds the limits or
    /// the memory of the device.
    pub fn new(gpu: &Gpu, scene: &Scene, geometry: &Geometry, band_pixels: u64) -> Result<Self, SceneError> {
        let device = &gpu.device;
        let memory = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let buffers = Self {
            scene: SceneBuffers::new(device, &gpu.queue, scene, geometry)?,
            image: band_buffer(device, band_pixels),
            kept: None,
        };
        match pollster::block_on(memory.pop()) {
            Some(error) => Err(SceneError(format!("the adapter does not have enough memory: {error}"))),
            None => Ok(buffers),
        }
    }

    /// Makes the buffers of a band larger or smaller. Returns whether they changed, so that they must
    /// be bound again.
    pub fn set_band(&mut self, gpu: &Gpu, pixels: u64) -> Result<bool, SceneError> {
        if self.image.size() == pixels * PIXEL_BYTES {
            return Ok(false);
        }
        let memory = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let image = band_buffer(&gpu.device, pixels);
        if let Some(error) = pollster::block_on(memory.pop()) {
            return Err(SceneError(format!("the adapter does not have enough memory: {error}")));
        }
        self.image = image;
        Ok(true)
    }

    /// Makes room for what so many pixels keep, unless no binding is as large. Returns whether the buffer changed.
    pub fn set_kept(&mut self, gpu: &Gpu, pixels: u64) -> Result<bool, SceneError> {
        let limits = gpu.device.limits();
        let size = 2 * KEPT_BYTES * pixels;
        let size = if size > limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) { 0 } else { size };
        if self.kept.as_ref().map_or(0, wgpu::Buffer::size) == size {
            return Ok(false);
        }
        let memory = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let (usage, mapped_at_creation) = (wgpu::BufferUsages::STORAGE, false);
        let descriptor = wgpu::BufferDescriptor { label: Some("city kept lights"), size, usage, mapped_at_creation };
        let kept = (size > 0).then(|| gpu.device.create_buffer(&descriptor));
        if let Some(error) = pollster::block_on(memory.pop()) {
            return Err(SceneError(format!("the adapter does not have enough memory: {error}")));
        }
        self.kept = kept;
        Ok(true)
    }

    /// Bind group 0 of the render shader, and its layout.
    pub fn bind(&self, device: &wgpu::Device) -> (wgpu::BindGroupLayout, wgpu::BindGroup) {
        self.scene.bind(device, &self.image, self.kept.as_ref())
    }
}

/// The buffer of a band of pixels.
fn band_buffer(device: &wgpu::Device, pixels: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("city image"),
        size: pixels * PIXEL_BYTES,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}

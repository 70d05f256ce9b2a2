//! Finds out whether the device was lost.
//!
//! A device has one callback for that, which is the engine's, and wgpu hides the errors of a lost device from error
//! scopes. But mapping a buffer of a lost device fails before the call returns, and of a live one after: at the next
//! poll, or when it is given up.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::error::GpuError;

/// Asks a device whether it is lost.
pub(crate) struct Probe {
    /// Four bytes that nobody else knows of.
    buffer: wgpu::Buffer,
}

impl Probe {
    /// Refuses a lost device.
    pub(crate) fn new(device: &wgpu::Device) -> Result<Self, GpuError> {
        // A buffer that a lost device made is not even one, which wgpu complains about when it is mapped.
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("girandole probe"),
            size: wgpu::COPY_BUFFER_ALIGNMENT,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let probe = Self { buffer };
        let checked = probe.check();
        drop(scope);
        checked.map(|()| probe)
    }

    /// [`GpuError::DeviceLost`] once wgpu knows of it; never waits. In browsers, where mapping fails later too, a
    /// loss is not found out.
    pub(crate) fn check(&self) -> Result<(), GpuError> {
        let failed = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&failed);
        self.buffer.map_async(wgpu::MapMode::Read, .., move |result| flag.store(result.is_err(), Ordering::Relaxed));
        let is_lost = failed.load(Ordering::Relaxed);
        // Gives up, which the callback hears of too, when nobody looks any more. A lost device has nothing to give up.
        if !is_lost {
            self.buffer.unmap();
        }
        if is_lost { Err(GpuError::DeviceLost) } else { Ok(()) }
    }
}

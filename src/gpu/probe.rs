//! Finds out whether the device was lost.
//!
//! A device has a single callback for its loss, which belongs to the engine, and wgpu hides the
//! errors of a lost device from error scopes. But the mapping of a buffer reveals the loss: on a
//! lost device it fails before the call returns. On a working one its callback runs later, at the
//! next poll or when the buffer is dropped.
//!
//! In browsers the mapping fails later on a lost device too, so there is nothing to find out and
//! nothing is made.

use super::error::GpuError;

/// Fails with [`GpuError::DeviceLost`] once wgpu has noticed the loss. Never waits, and never
/// fails in browsers. Makes a buffer of four bytes and drops it, which takes a few microseconds.
#[cfg(not(target_family = "wasm"))]
pub(crate) fn check(device: &wgpu::Device) -> Result<(), GpuError> {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    let has_failed = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&has_failed);
    // A lost device makes an invalid buffer, and wgpu reports an error when that is mapped.
    let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("girandole probe"),
        size: wgpu::COPY_BUFFER_ALIGNMENT,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    buffer.map_async(wgpu::MapMode::Read, .., move |result| flag.store(result.is_err(), Ordering::Relaxed));
    let is_lost = has_failed.load(Ordering::Relaxed);
    // This cancels the mapping. The callback then runs with an error, but the flag is no longer
    // read. `unmap` on a buffer that is kept could fail while another thread polls: for a moment
    // wgpu takes the buffer for neither waiting nor mapped.
    drop(buffer);
    drop(scope);
    if is_lost { Err(GpuError::DeviceLost) } else { Ok(()) }
}

/// Does nothing: see the module's documentation.
#[cfg(target_family = "wasm")]
pub(crate) fn check(_device: &wgpu::Device) -> Result<(), GpuError> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;
    use crate::gpu::testing::limited_gpu;

    #[test]
    fn other_threads_may_poll_while_a_device_is_checked() {
        let (device, _queue) = limited_gpu(&wgpu::Limits::default(), wgpu::Features::empty());
        let is_done = AtomicBool::new(false);
        std::thread::scope(|threads| {
            threads.spawn(|| {
                while !is_done.load(Ordering::Relaxed) {
                    device.poll(wgpu::PollType::Poll).expect("the device works");
                }
            });
            // When `unmap` cancelled the mapping, some 100,000 checks were enough to meet the
            // error, which panics.
            let ask = || (0..200_000).all(|_| check(&device).is_ok());
            let answers = std::panic::catch_unwind(std::panic::AssertUnwindSafe(ask));
            is_done.store(true, Ordering::Relaxed);
            assert!(answers.expect("wgpu reports no error"), "the device works");
        });
    }
}

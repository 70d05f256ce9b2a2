//! Finds out whether the device was lost.
//!
//! A device has one callback for that, which is the engine's, and wgpu hides the errors of a lost device from error
//! scopes. But mapping a buffer of a lost device fails before the call returns, and of a live one after: at the next
//! poll, or when it is given up.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::error::GpuError;

/// [`GpuError::DeviceLost`] once wgpu knows of it; never waits. In browsers, where mapping fails later too, a loss is
/// not found out. Makes a buffer of four bytes and drops it: a few microseconds.
pub(crate) fn check(device: &wgpu::Device) -> Result<(), GpuError> {
    let failed = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&failed);
    // A buffer that a lost device made is not even one, which wgpu complains about when it is mapped.
    let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("girandole probe"),
        size: wgpu::COPY_BUFFER_ALIGNMENT,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    buffer.map_async(wgpu::MapMode::Read, .., move |result| flag.store(result.is_err(), Ordering::Relaxed));
    let is_lost = failed.load(Ordering::Relaxed);
    // Gives up, which the callback hears of too, when nobody looks any more. To unmap a buffer that is kept would be an
    // error while a poll of another thread maps it: for a moment wgpu has it neither waiting nor mapped.
    drop(buffer);
    drop(scope);
    if is_lost { Err(GpuError::DeviceLost) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::testing::limited_gpu;

    #[test]
    fn other_threads_may_poll_while_a_device_is_asked() {
        let (device, _queue) = limited_gpu(&wgpu::Limits::default(), wgpu::Features::empty());
        let is_done = AtomicBool::new(false);
        std::thread::scope(|threads| {
            threads.spawn(|| {
                while !is_done.load(Ordering::Relaxed) {
                    device.poll(wgpu::PollType::Poll).expect("the device lives");
                }
            });
            // Where the mapping was taken back by `unmap`, some 100,000 of these met an error, which panics.
            let ask = || (0..200_000).all(|_| check(&device).is_ok());
            let answers = std::panic::catch_unwind(std::panic::AssertUnwindSafe(ask));
            is_done.store(true, Ordering::Relaxed);
            assert!(answers.expect("no error of wgpu"), "the device lives");
        });
    }
}

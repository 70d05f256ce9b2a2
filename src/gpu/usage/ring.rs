//! The buffers in which counts travel back to the CPU, a few frames after they were made.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use super::super::memory;

/// The number of collections that may be under way: the frames that a GPU lags behind, and one
/// more.
const RING: usize = 3;

/// The buffer may be used.
const FREE: u8 = 0;
/// The copy is recorded; the buffer is not mapped yet.
const UNDER_WAY: u8 = 1;
/// The buffer is mapped.
const ARRIVED: u8 = 2;

/// Buffers for the collections of counts, which are numbered in the order of recording.
#[derive(Default)]
pub(super) struct Ring {
    read_backs: [ReadBack; RING],
    next: u64,
}

/// A buffer that the CPU can map, and the collection in it.
#[derive(Default)]
struct ReadBack {
    /// Made at first use, and again for more slots.
    buffer: Option<wgpu::Buffer>,
    /// The bytes of its collection.
    bytes: u64,
    /// The number of its collection.
    number: u64,
    state: Arc<AtomicU8>,
}

/// Travels with the commands of a collection and reports when the buffer is mapped. If it is
/// dropped without a report, as with an encoder that is never submitted, it frees the buffer.
struct Notice(Arc<AtomicU8>);

impl Notice {
    fn arrived(self) {
        self.0.store(ARRIVED, Ordering::Release);
    }
}

impl Drop for Notice {
    fn drop(&mut self) {
        let _ = self.0.compare_exchange(UNDER_WAY, FREE, Ordering::AcqRel, Ordering::Relaxed);
    }
}

impl Ring {
    /// The number of the next collection.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// Records a copy of the first `bytes` bytes of a buffer. Returns `false` and records nothing
    /// if no buffer is free, or if the device has no memory for a buffer.
    pub fn record(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        counts: &wgpu::Buffer,
        bytes: u64,
    ) -> bool {
        let is_free = |read_back: &&mut ReadBack| read_back.state.load(Ordering::Acquire) == FREE;
        let Some(read_back) = self.read_backs.iter_mut().find(is_free) else { return false };
        if read_back.buffer.as_ref().is_none_or(|buffer| buffer.size() < bytes) {
            let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
            // As large as the source, which grows by doubling.
            read_back.buffer = memory::create_buffer(device, "usage counters, read back", counts.size(), usage).ok();
        }
        let Some(buffer) = &read_back.buffer else { return false };
        encoder.copy_buffer_to_buffer(counts, 0, buffer, 0, bytes);
        read_back.state.store(UNDER_WAY, Ordering::Release);
        let notice = Notice(Arc::clone(&read_back.state));
        encoder.map_buffer_on_submit(buffer, wgpu::MapMode::Read, ..bytes, move |result| {
            if result.is_ok() {
                notice.arrived();
            }
        });
        read_back.bytes = bytes;
        read_back.number = self.next;
        self.next += 1;
        true
    }

    /// Passes the number and the bytes of each collection that has arrived to `add`, and frees its
    /// buffer. Returns whether any has arrived.
    pub fn take(&mut self, device: &wgpu::Device, mut add: impl FnMut(u64, &[u8])) -> bool {
        let mut has_any = false;
        for read_back in &mut self.read_backs {
            if read_back.state.load(Ordering::Acquire) != ARRIVED {
                continue;
            }
            let Some(buffer) = &read_back.buffer else { continue };
            // A lost device also loses its mappings: there is nothing to read, and unmapping is an
            // error.
            let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
            if let Some(view) = buffer.get_mapped_range(..read_back.bytes).view() {
                add(read_back.number, &view);
                has_any = true;
            }
            buffer.unmap();
            drop(scope);
            read_back.state.store(FREE, Ordering::Release);
        }
        has_any
    }
}

/// The result of `get_mapped_range`: a view in wgpu 29, a `Result` from wgpu 30 on.
trait Mapped {
    fn view(self) -> Option<wgpu::BufferView>;
}

impl Mapped for wgpu::BufferView {
    fn view(self) -> Option<wgpu::BufferView> {
        Some(self)
    }
}

impl<E> Mapped for Result<wgpu::BufferView, E> {
    fn view(self) -> Option<wgpu::BufferView> {
        self.ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::memory::refusals::Refusals;
    use crate::gpu::testing::noop;

    #[test]
    fn a_collection_whose_buffer_is_refused_is_not_recorded() {
        let (device, _queue) = noop();
        let usage = wgpu::BufferUsages::COPY_SRC;
        let counts = memory::create_buffer(&device, "test counts", 64, usage).expect("room enough");
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut ring = Ring::default();
        {
            let _refusals = Refusals::of_buffers_after(0);
            assert!(!ring.record(&device, &mut encoder, &counts, 64));
        }
        assert_eq!(ring.next(), 0);
        assert!(ring.record(&device, &mut encoder, &counts, 64));
        assert_eq!(ring.next(), 1);
    }
}

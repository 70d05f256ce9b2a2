//! The buffers in which counts come back, a few frames after they were made.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// Collections that may be underway: frames that GPUs are behind, and one more.
const RING: usize = 3;

/// Nobody uses the buffer.
const FREE: u8 = 0;
/// The copy is recorded; the buffer is not mapped yet.
const UNDERWAY: u8 = 1;
/// The buffer is mapped.
const ARRIVED: u8 = 2;

/// Buffers for the collections of counts, which are numbered in the order they were recorded.
#[derive(Default)]
pub(super) struct Ring {
    places: [Place; RING],
    next: u64,
}

#[derive(Default)]
struct Place {
    /// Made when first needed, and anew for more slots.
    buffer: Option<wgpu::Buffer>,
    /// What it holds or will hold.
    bytes: u64,
    number: u64,
    state: Arc<AtomicU8>,
}

/// Tells a place what becomes of its collection: dropped without a word, as with an encoder that is never submitted, it
/// says that the place is free.
struct Notice(Arc<AtomicU8>);

impl Notice {
    fn arrived(self) {
        self.0.store(ARRIVED, Ordering::Release);
    }
}

impl Drop for Notice {
    fn drop(&mut self) {
        let _ = self.0.compare_exchange(UNDERWAY, FREE, Ordering::AcqRel, Ordering::Relaxed);
    }
}

impl Ring {
    /// The number of the next collection.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// Records a copy of the first `bytes` of a buffer, if a place is free.
    pub fn record(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        counts: &wgpu::Buffer,
        bytes: u64,
    ) -> bool {
        let is_free = |place: &&mut Place| place.state.load(Ordering::Acquire) == FREE;
        let Some(place) = self.places.iter_mut().find(is_free) else { return false };
        if place.buffer.as_ref().is_none_or(|buffer| buffer.size() < bytes) {
            place.buffer = Some(device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("girandole picks, read back"),
                // As roomy as what is copied, which grows by doubling.
                size: counts.size(),
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }));
        }
        let Some(buffer) = &place.buffer else { return false };
        encoder.copy_buffer_to_buffer(counts, 0, buffer, 0, bytes);
        place.state.store(UNDERWAY, Ordering::Release);
        let notice = Notice(Arc::clone(&place.state));
        encoder.map_buffer_on_submit(buffer, wgpu::MapMode::Read, ..bytes, move |result| {
            if result.is_ok() {
                notice.arrived();
            }
        });
        place.bytes = bytes;
        place.number = self.next;
        self.next += 1;
        true
    }

    /// Hands out the bytes of each collection that has arrived, with its number, and frees its place. Returns whether
    /// there was any.
    pub fn take(&mut self, device: &wgpu::Device, mut add: impl FnMut(u64, &[u8])) -> bool {
        let mut has_any = false;
        for place in &mut self.places {
            if place.state.load(Ordering::Acquire) != ARRIVED {
                continue;
            }
            let Some(buffer) = &place.buffer else { continue };
            // What a lost device had mapped is gone: nothing to read, and an error to unmap.
            let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
            if let Some(view) = buffer.get_mapped_range(..place.bytes).view() {
                add(place.number, &view);
                has_any = true;
            }
            buffer.unmap();
            drop(scope);
            place.state.store(FREE, Ordering::Release);
        }
        has_any
    }
}

/// What mapping gives: a view, or from wgpu 30 on an error in place of a panic.
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

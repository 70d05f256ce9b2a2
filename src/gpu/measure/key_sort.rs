//! The sort of the top-level build, alone.

use super::super::error::GpuError;
use super::super::memory;
use super::super::recorder::Recorder;
use super::super::sort::{RadixSort, SortBuffers};
use crate::dice::hash;

/// Sorts random 32-bit keys with their values, as the top-level build sorts its instances. The
/// time of a build can be compared with the time of a sort of as many keys.
#[derive(Debug)]
pub struct KeySort {
    sort: RadixSort,
    buffers: SortBuffers,
    /// The keys before the sort.
    pub(super) unsorted: wgpu::Buffer,
}

impl KeySort {
    /// Makes pipelines, buffers and `count` keys, the same keys every time.
    ///
    /// # Errors
    /// [`GpuError::Full`] if the device cannot bind `count` keys as one buffer;
    /// [`GpuError::OutOfMemory`].
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, count: u32) -> Result<Self, GpuError> {
        let sort = RadixSort::new(device);
        let mut buffers = SortBuffers::new(device, &sort, count)?;
        buffers.set_count(queue, count);
        // A buffer without bytes could not be copied.
        let keys: Vec<u32> = (0..count.max(1)).map(hash).collect();
        let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let unsorted = memory::create_buffer(device, "unsorted keys", 4 * keys.len() as u64, usage)?;
        queue.write_buffer(&unsorted, 0, bytemuck::cast_slice(&keys));
        Ok(Self { sort, buffers, unsorted })
    }

    /// Records a copy of the unsorted keys and then, in a compute pass of its own, their sort.
    /// Returns the number of dispatches of the sort. If `queries` is given, the pass begins at its
    /// timestamp 0 and ends at 1.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, queries: Option<&wgpu::QuerySet>) -> u32 {
        encoder.copy_buffer_to_buffer(&self.unsorted, 0, self.buffers.keys(), 0, self.unsorted.size());
        let mut recorder = Recorder::apart(encoder, "girandole sort", queries);
        recorder.stage("sort");
        self.sort.record(&mut recorder, &self.buffers);
        recorder.finish().iter().map(|stage| stage.dispatches).sum()
    }

    /// The keys, as `u32`; in ascending order once the sort has run.
    pub fn keys(&self) -> &wgpu::Buffer {
        self.buffers.keys()
    }
}

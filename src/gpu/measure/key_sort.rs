//! The sort of the top level by itself.

use super::super::error::GpuError;
use super::super::memory;
use super::super::recorder::Recorder;
use super::super::sort::{RadixSort, SortBuffers};

/// Sorts random 32-bit keys with their values, as the top level sorts its instances: what a build over as many takes
/// can be held against it.
pub struct KeySort {
    sort: RadixSort,
    buffers: SortBuffers,
    /// The keys as they were.
    pub(super) unsorted: wgpu::Buffer,
}

impl KeySort {
    /// Makes pipelines, buffers and `count` keys, always the same.
    ///
    /// # Errors
    /// [`GpuError::Full`] where the device cannot bind as many, [`GpuError::OutOfMemory`].
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, count: u32) -> Result<Self, GpuError> {
        let sort = RadixSort::new(device);
        let mut buffers = SortBuffers::new(device, &sort, count)?;
        buffers.set_count(queue, count);
        // One buffer at least has to be copied.
        let keys: Vec<u32> = (0..count.max(1)).map(mix).collect();
        let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let unsorted = memory::create_buffer(device, "unsorted keys", 4 * keys.len() as u64, usage)?;
        queue.write_buffer(&unsorted, 0, bytemuck::cast_slice(&keys));
        Ok(Self { sort, buffers, unsorted })
    }

    /// Records a copy of the unsorted keys and, in a compute pass of its own, their sort. Returns its dispatches. The
    /// pass begins at timestamp 0 and ends at 1 of `queries`, if any are given.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, queries: Option<&wgpu::QuerySet>) -> u32 {
        encoder.copy_buffer_to_buffer(&self.unsorted, 0, self.buffers.keys(), 0, self.unsorted.size());
        let mut recorder = Recorder::apart(encoder, "girandole sort", queries);
        recorder.stage("sort");
        self.sort.record(&mut recorder, &self.buffers);
        recorder.finish().iter().map(|stage| stage.dispatches).sum()
    }

    /// The keys: ascending once the sort has run.
    pub fn keys(&self) -> &wgpu::Buffer {
        self.buffers.keys()
    }
}

/// Well-mixed bits: the output function of SplitMix64.
fn mix(i: u32) -> u32 {
    let x = u64::from(i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (x >> 32) as u32
}

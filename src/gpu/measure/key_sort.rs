//! The sort of the top-level build, alone.

use super::super::error::{GpuError, largest_storage_buffer};
use super::super::memory;
use super::super::player::Player;
use super::super::recorder::Recorder;
use crate::math::dice::hash;
use crate::plan::Commands;
use crate::plan::buffers::Ids;
use crate::plan::draft::Draft;
use crate::plan::pool::Growth;
use crate::plan::sort::SortBuffers;

/// Sorts random 32-bit keys with their values, as the top-level build sorts its instances. The
/// time of a build can be compared with the time of a sort of as many keys.
#[derive(Debug)]
pub struct KeySort {
    player: Player,
    buffers: SortBuffers,
    sort: Commands,
    /// The keys before the sort.
    unsorted: wgpu::Buffer,
}

impl KeySort {
    /// Makes pipelines, buffers and `count` keys, the same keys every time.
    ///
    /// # Errors
    /// [`GpuError::Full`] if the device cannot bind `count` keys as one buffer;
    /// [`GpuError::OutOfMemory`].
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, count: u32) -> Result<Self, GpuError> {
        SortBuffers::fit(count, largest_storage_buffer(device))?;
        let (mut player, mut draft) = (Player::new(device, queue), Draft::new(Ids::default(), Growth::Exact));
        let mut buffers = SortBuffers::new(count, &mut draft);
        player.create(&draft.plan.new_buffers)?;
        let (mut upload, mut sort) = (Commands::default(), Commands::default());
        buffers.set_count(&mut upload, count);
        buffers.sort(&mut sort);
        player.play(&upload);
        // A buffer without bytes could not be copied.
        let keys: Vec<u32> = (0..count.max(1)).map(hash).collect();
        let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let unsorted = memory::create_buffer(device, "unsorted keys", 4 * keys.len() as u64, usage)?;
        queue.write_buffer(&unsorted, 0, bytemuck::cast_slice(&keys));
        Ok(Self { player, buffers, sort, unsorted })
    }

    /// Records a copy of the unsorted keys and then, in a compute pass of its own, their sort.
    /// Returns the number of dispatches of the sort. If `queries` is given, the pass begins at its
    /// timestamp 0 and ends at 1.
    pub fn record(&mut self, encoder: &mut wgpu::CommandEncoder, queries: Option<&wgpu::QuerySet>) -> u32 {
        encoder.copy_buffer_to_buffer(&self.unsorted, 0, self.keys(), 0, self.unsorted.size());
        let mut recorder = Recorder::apart(encoder, "girandole sort", queries);
        self.player.record(&mut recorder, &self.sort);
        recorder.finish().iter().map(|stage| stage.dispatches).sum()
    }

    /// The keys before the sort, as `u32`.
    pub fn unsorted(&self) -> &wgpu::Buffer {
        &self.unsorted
    }

    /// The keys, as `u32`; in ascending order once the sort has run.
    pub fn keys(&self) -> &wgpu::Buffer {
        self.player.buffer(self.buffers.keys)
    }
}

//! The uniform with the number of candidates that a kernel draws.

use super::error::GpuError;
use super::memory;
use crate::plan::UNIFORM_ALIGNMENT;
use crate::plan::kernel::pass_bytes;
use crate::sampling::counts::{CandidateCount, MAX_CANDIDATES};

/// A `vec4<u32>` for each possible count, so that a call of
/// [`GpuLights::resample`](super::GpuLights::resample) neither makes a buffer nor writes one.
pub(super) struct CandidateTable(wgpu::Buffer);

impl CandidateTable {
    /// Takes 8 KiB: 256 bytes, the alignment of WebGPU, for each count.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Self, GpuError> {
        let counts: Vec<[u32; 4]> = (1..=MAX_CANDIDATES).map(|count| [count, 0, 0, 0]).collect();
        let bytes = pass_bytes(&counts, UNIFORM_ALIGNMENT);
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let buffer = memory::create_buffer(device, "candidate counts", bytes.len() as u64, usage)?;
        queue.write_buffer(&buffer, 0, &bytes);
        Ok(Self(buffer))
    }

    /// The uniform for a count.
    pub fn binding(&self, candidates: CandidateCount) -> wgpu::BindingResource<'_> {
        wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &self.0,
            offset: u64::from(candidates.get() - 1) * u64::from(UNIFORM_ALIGNMENT),
            size: wgpu::BufferSize::new(size_of::<[u32; 4]>() as u64),
        })
    }
}

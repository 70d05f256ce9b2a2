//! The buffers of the top level whose sizes follow the number of parts.

use super::super::error::{GpuError, largest_storage_buffer};
use super::super::layout::{ClusterRecord, LeafRecord, Strides};
use super::super::memory;
use super::super::sort::{RadixSort, SortBuffers};
use super::plan::{Places, Plan};
use crate::effects::Effects;
use crate::tree::{Node, WIDTH};

/// The bytes of the masks of one node: a word for each child.
pub(super) const MASK_BYTES: u64 = 4 * WIDTH as u64;

/// The extremes of all means, the number of parts that are not dark, and one unused word.
const BOUNDS_BYTES: u64 = 32;

#[derive(Debug)]
pub(super) struct TopBuffers {
    /// The number of parts that there is room for.
    pub capacity: u32,
    pub places: Places,
    pub bounds: wgpu::Buffer,
    /// The nodes, then the parts, then the masks of the nodes if they are stored.
    pub nodes: wgpu::Buffer,
    /// The clusters of all parts, then of all nodes.
    pub clusters: wgpu::Buffer,
    /// The lists of units that the rounds leave.
    pub units: wgpu::Buffer,
    pub sort: SortBuffers,
}

impl TopBuffers {
    /// Makes room for `capacity` parts, and for masks if `has_masks`. Fails with [`GpuError::Full`] if a buffer would be larger
    /// than the device can bind, and with [`GpuError::OutOfMemory`].
    pub(super) fn new(
        device: &wgpu::Device,
        sort: &RadixSort,
        capacity: u32,
        has_masks: bool,
    ) -> Result<Self, GpuError> {
        let limit = largest_storage_buffer(device);
        let plan = Plan::new(capacity, capacity, Places::default(), Strides::of(Effects::all()));
        let parts = u64::from(plan.nodes) * size_of::<Node>() as u64;
        let masks = parts + u64::from(capacity) * size_of::<LeafRecord>() as u64;
        let nodes = masks + if has_masks { u64::from(plan.nodes) * MASK_BYTES } else { 0 };
        let clusters = (u64::from(capacity) + u64::from(plan.nodes)) * size_of::<ClusterRecord>() as u64;
        let units = u64::from(plan.words) * 4;
        for (what, needed) in [("top-level clusters", clusters), ("top-level nodes", nodes)] {
            if needed > limit {
                return Err(GpuError::Full { what, needed, limit });
            }
        }
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let buffer = |what, bytes| memory::create_buffer(device, what, bytes, usage);
        Ok(Self {
            capacity,
            // Within the limit of the buffer.
            places: Places { parts: (parts / 16) as u32, masks: if has_masks { (masks / 16) as u32 } else { 0 } },
            sort: SortBuffers::new(device, sort, capacity)?,
            bounds: buffer("top level bounds", BOUNDS_BYTES)?,
            nodes: buffer("top level nodes", nodes)?,
            clusters: buffer("top level clusters", clusters)?,
            units: buffer("top level units", units)?,
        })
    }
}

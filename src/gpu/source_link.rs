//! What the GPU tells and is told about trees whose lights kernels of the engine write.

use std::collections::VecDeque;

use super::bindings::storage_entry;
use super::fate::Watch;
use crate::keys::TreeKey;
use crate::plan::{BufferId, Readback};
use crate::world::LightWorld;

/// The trees that are measured in one frame.
pub(super) const MEASURED_PER_FRAME: u32 = 32;

/// The parts of trees whose places are read back in one frame, and the most ranges that they make.
pub(super) const PARTS_PER_FRAME: u32 = 2048;
pub(super) const PART_RANGES_PER_FRAME: usize = 32;

/// The bytes of lights that are read back in one frame, unless the first tree has more.
pub(super) const LIGHT_BYTES_PER_FRAME: u64 = 4 << 20;

/// The most trees whose lights are being read back or wait for their rebuild. A longer queue would make rebuilds
/// use older lights.
pub(super) const MAX_READ: usize = 16;

/// The most frames that wait for the GPU. Later ones read nothing back.
pub(super) const MAX_WAITING: usize = 4;

/// What the GPU tells and is told about trees with a source.
#[derive(Debug)]
pub(super) struct SourceLink {
    pub layout: wgpu::BindGroupLayout,
    /// The bind group of kernels of the engine, and the buffers that it was made for.
    pub group: Option<([BufferId; 2], wgpu::BindGroup)>,
    /// The number of the source that is measured next.
    pub next: u32,
    /// The trees whose lights are to be read back, in order.
    pub wanted: VecDeque<TreeKey>,
    /// The trees whose lights were read back, and that wait for their rebuild.
    pub read: Vec<TreeKey>,
    /// In the order in which they were recorded.
    pub copies: VecDeque<Copies>,
    /// A buffer that may be used again.
    pub spare: Option<wgpu::Buffer>,
}

/// Copies that were recorded in one frame, one after the other in a buffer.
#[derive(Debug)]
pub(super) struct Copies {
    pub buffer: wgpu::Buffer,
    pub watch: Watch,
    pub ranges: Vec<Readback>,
}

impl Copies {
    /// The trees whose lights are among them.
    pub fn lights(&self) -> impl Iterator<Item = TreeKey> {
        self.ranges.iter().filter_map(Readback::tree_of_lights)
    }
}

/// What mapped buffers return: wgpu 30 can fail where wgpu 29 panics.
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

impl SourceLink {
    pub fn new(device: &wgpu::Device) -> Self {
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("girandole sources"),
            entries: &[storage_entry(0, false), storage_entry(1, false)],
        });
        let (wanted, copies) = (VecDeque::new(), VecDeque::new());
        Self { layout, group: None, next: 0, wanted, read: Vec::new(), copies, spare: None }
    }

    /// How many trees have lights that are being read back or wait for their rebuild.
    pub fn underway(&self) -> usize {
        self.read.len() + self.copies.iter().flat_map(Copies::lights).count()
    }

    /// Tells the world what some copies say.
    pub fn take(&mut self, copies: &Copies, world: &mut LightWorld) {
        let end: u64 = copies.ranges.iter().map(|range| range.bytes).sum();
        let Some(bytes) = copies.buffer.slice(..end).get_mapped_range().view() else { return };
        self.read.extend(copies.lights());
        let mut bytes = &bytes[..];
        for range in &copies.ranges {
            let (own, rest) = bytes.split_at(range.bytes as usize);
            for tree in range.apply(world, own) {
                let mut copied = self.copies.iter().flat_map(Copies::lights).chain(copies.lights());
                if !copied.any(|other| other == tree) && !self.wanted.contains(&tree) {
                    self.wanted.push_back(tree);
                }
            }
            bytes = rest;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::documented::{assert_says, grouped};

    #[test]
    fn the_documentation_names_what_is_read_back() {
        let says = |sentence: &str| assert_says(include_str!("sources.rs"), sentence);
        says(&format!("measures {MEASURED_PER_FRAME} of them"));
        let parts = grouped(PARTS_PER_FRAME as usize);
        says(&format!("where {parts} of their parts are, 80 bytes each, in at most {PART_RANGES_PER_FRAME} ranges"));
        assert_says(include_str!("../../docs/gpu-lights.md"), &format!("where {parts} parts"));
    }
}

//! What the GPU tells and is told about trees whose lights kernels of the engine write.

use std::collections::{HashSet, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use crate::keys::TreeKey;
use crate::plan::{BufferId, LightReadback, MeasureReadback, PartReadback};
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

/// The states of a [`Readback`].
pub(super) const WAITS: u8 = 0;
pub(super) const IS_READABLE: u8 = 1;
pub(super) const IS_LOST: u8 = 2;

/// What the GPU tells and is told about trees with a source.
#[derive(Debug)]
pub(super) struct SourceLink {
    pub layout: wgpu::BindGroupLayout,
    /// The bind group of kernels of the engine, and the buffers that it was made for.
    pub group: Option<([BufferId; 2], wgpu::BindGroup)>,
    /// The number of the source that is measured next.
    pub next: u32,
    /// The trees whose lights are to be read back, in order, and the same as a set.
    pub wanted: VecDeque<TreeKey>,
    pub are_wanted: HashSet<TreeKey>,
    /// The trees whose lights were read back, and that wait for their rebuild.
    pub read: Vec<TreeKey>,
    /// In the order in which they were recorded.
    pub readbacks: VecDeque<Readback>,
    /// A buffer that may be used again.
    pub spare: Option<wgpu::Buffer>,
}

/// Copies that were recorded in one frame, one after the other in a buffer.
#[derive(Debug)]
pub(super) struct Readback {
    pub buffer: wgpu::Buffer,
    pub state: Arc<AtomicU8>,
    pub measures: MeasureReadback,
    pub parts: Vec<PartReadback>,
    pub lights: Vec<LightReadback>,
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

/// Travels with the commands of a readback, and tells what became of them.
pub(super) struct Fate(pub Arc<AtomicU8>);

impl Drop for Fate {
    fn drop(&mut self) {
        // The commands were dropped before they were submitted.
        let _ = self.0.compare_exchange(WAITS, IS_LOST, Ordering::AcqRel, Ordering::Relaxed);
    }
}

impl SourceLink {
    pub fn new(device: &wgpu::Device) -> Self {
        let entry = |binding| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only: false },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("girandole sources"),
            entries: &[entry(0), entry(1)],
        });
        let (wanted, readbacks) = (VecDeque::new(), VecDeque::new());
        let are_wanted = HashSet::new();
        Self { layout, group: None, next: 0, wanted, are_wanted, read: Vec::new(), readbacks, spare: None }
    }
}

impl SourceLink {
    /// Tells the world what a readback says.
    pub fn take(&mut self, readback: &Readback, world: &mut LightWorld) {
        let Readback { buffer, measures, parts, lights, .. } = readback;
        let sizes = parts.iter().map(|parts| parts.bytes).chain(lights.iter().map(|lights| lights.bytes));
        let end = measures.bytes + sizes.sum::<u64>();
        let Some(bytes) = buffer.slice(..end).get_mapped_range().view() else { return };
        let mut at = measures.bytes as usize;
        for parts in parts {
            parts.apply(world, &bytes[at..][..parts.bytes as usize]);
            at += parts.bytes as usize;
        }
        for lights in lights {
            lights.apply(world, &bytes[at..][..lights.bytes as usize]);
            self.read.push(lights.tree);
            at += lights.bytes as usize;
        }
        for tree in measures.apply(world, &bytes[..measures.bytes as usize]) {
            let is_underway = self.readbacks.iter().any(|r| r.lights.iter().any(|l| l.tree == tree))
                || lights.iter().any(|lights| lights.tree == tree);
            if !is_underway && self.are_wanted.insert(tree) {
                self.wanted.push_back(tree);
            }
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

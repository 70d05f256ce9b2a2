//! Trees whose lights kernels of the engine write: the bind group of these kernels, and what is read back.

use std::collections::{HashSet, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use super::{GpuLights, memory};
use crate::keys::TreeKey;
use crate::plan::{BufferId, LightReadback, MeasureReadback, wgsl_of_sources};
use crate::world::LightWorld;

/// The trees that are measured in one frame.
const MEASURED_PER_FRAME: u32 = 256;

/// The bytes of lights that are read back in one frame, unless the first tree has more.
const LIGHT_BYTES_PER_FRAME: u64 = 4 << 20;

/// The most trees that were read back, or are being read, and have not been rebuilt yet: those that wait for
/// longer would be built of old lights.
const MAX_READ: usize = 16;

/// The most frames that wait for the GPU. Later ones read nothing back.
const MAX_WAITING: usize = 4;

/// The states of a [`Readback`].
const WAITS: u8 = 0;
const IS_READABLE: u8 = 1;
const IS_LOST: u8 = 2;

/// What the GPU tells and is told about trees with a source.
#[derive(Debug)]
pub(super) struct SourceLink {
    layout: wgpu::BindGroupLayout,
    /// The bind group of kernels of the engine, and the buffers that it was made for.
    group: Option<([BufferId; 2], wgpu::BindGroup)>,
    /// The number of the source that is measured next.
    next: u32,
    /// The trees whose lights are to be read back, in order, and the same as a set.
    wanted: VecDeque<TreeKey>,
    are_wanted: HashSet<TreeKey>,
    /// The trees whose lights were read back, and that wait for their rebuild.
    read: Vec<TreeKey>,
    /// In the order in which they were recorded.
    readbacks: VecDeque<Readback>,
    /// A buffer that may be used again.
    spare: Option<wgpu::Buffer>,
}

/// Copies that were recorded in one frame, one after the other in a buffer.
#[derive(Debug)]
struct Readback {
    buffer: wgpu::Buffer,
    state: Arc<AtomicU8>,
    measures: MeasureReadback,
    lights: Vec<LightReadback>,
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
struct Fate(Arc<AtomicU8>);

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

impl GpuLights {
    /// The WGSL text for kernels that write the lights of trees with a [source](crate::TreeSource): see
    /// [`wgsl_of_sources`]. `group` is the number of [`GpuLights::source_group`].
    pub fn source_shader(&self, group: u32) -> String {
        wgsl_of_sources(group)
    }

    /// The layout of [`GpuLights::source_group`]: two storage buffers for compute stages.
    pub fn source_layout(&self) -> &wgpu::BindGroupLayout {
        &self.sources.layout
    }

    /// The bind group for kernels that write lights; `None` until an upload has sent a tree with a
    /// [source](crate::TreeSource), and while there is no memory for the lights.
    ///
    /// Call it in each frame after [`GpuLights::upload`], and record the kernels before
    /// [`GpuLights::build_top`], which refits the trees. What kernels have not written is as in the last frame;
    /// but an upload that sends a tree anew, as after a rebuild, sends the lights as the CPU knows them. So
    /// write all lights in each frame.
    pub fn source_group(&mut self) -> Option<&wgpu::BindGroup> {
        let buffers = self.planner.source_bindings().filter(|_| !self.is_dark)?;
        if self.sources.group.as_ref().is_none_or(|(bound, _)| *bound != buffers) {
            let entry = |(binding, id): (u32, &BufferId)| wgpu::BindGroupEntry {
                binding,
                resource: self.player.buffer(*id).as_entire_binding(),
            };
            let entries: Vec<_> = (0..).zip(&buffers).map(entry).collect();
            let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("girandole sources"),
                layout: &self.sources.layout,
                entries: &entries,
            });
            self.sources.group = Some((buffers, group));
        }
        self.sources.group.as_ref().map(|(_, group)| group)
    }

    /// Tells the world what the GPU has found out about trees with a [source](crate::TreeSource), so that
    /// policies and the scheduler know of them. Call it once a frame before [`LightWorld::update`];
    /// [`GpuLights::sync`] does.
    ///
    /// Each build of the top level refits these trees, measures 256 of them, and copies 32 bytes for each into a
    /// buffer that is read some frames later; nothing waits for the GPU. Trees whose policies request a rebuild
    /// have their lights copied too, at most 4 MiB a frame or one tree. The world then holds these
    /// lights, and rebuilds the tree within its budget. O(trees that were measured, lights that were copied).
    pub fn follow_sources(&mut self, world: &mut LightWorld) {
        self.sources.read.retain(|tree| world.rebuild_state(*tree).is_some_and(|state| state.waited.is_some()));
        while let Some(state) = self.sources.readbacks.front().map(|readback| readback.state.load(Ordering::Acquire)) {
            if state == WAITS {
                return;
            }
            let Some(readback) = self.sources.readbacks.pop_front() else { return };
            if state == IS_LOST {
                continue;
            }
            self.sources.take(&readback, world);
            readback.buffer.unmap();
            self.sources.spare = Some(readback.buffer);
        }
    }

    /// Records copies of what the refit found out, and of lights that are wanted.
    pub(super) fn record_readback(&mut self, encoder: &mut wgpu::CommandEncoder) {
        let Self { planner, player, sources, device, .. } = self;
        if sources.readbacks.len() >= MAX_WAITING {
            return;
        }
        sources.next = if sources.next < planner.source_count() { sources.next } else { 0 };
        let Some(measures) = planner.measures(sources.next, MEASURED_PER_FRAME) else { return };
        sources.next += MEASURED_PER_FRAME;
        let (mut bytes, mut lights) = (measures.bytes, Vec::new());
        let underway = sources.read.len() + sources.readbacks.iter().map(|other| other.lights.len()).sum::<usize>();
        while underway + lights.len() < MAX_READ
            && let Some(tree) = sources.wanted.front()
        {
            let of_tree = planner.source_lights(*tree);
            let more = of_tree.as_ref().map_or(0, |of_tree| of_tree.bytes);
            if !lights.is_empty() && bytes + more > LIGHT_BYTES_PER_FRAME {
                break;
            }
            bytes += more;
            lights.extend(of_tree);
            sources.are_wanted.remove(tree);
            sources.wanted.pop_front();
        }
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let spare = sources.spare.take().filter(|spare| spare.size() >= bytes);
        let made = || memory::create_buffer(device, "readback", bytes.next_power_of_two(), usage);
        // Without memory, the trees ask again.
        let Some(buffer) = spare.map_or_else(|| made().ok(), Some) else { return };
        let ranges = std::iter::once((measures.buffer, measures.offset, measures.bytes));
        let mut at = 0;
        for (from, offset, bytes) in ranges.chain(lights.iter().map(|l| (l.buffer, l.offset, l.bytes))) {
            encoder.copy_buffer_to_buffer(player.buffer(from), offset, &buffer, at, Some(bytes));
            at += bytes;
        }
        let state = Arc::new(AtomicU8::new(WAITS));
        let fate = Fate(Arc::clone(&state));
        encoder.map_buffer_on_submit(&buffer, wgpu::MapMode::Read, 0..at, move |result| {
            fate.0.store(if result.is_ok() { IS_READABLE } else { IS_LOST }, Ordering::Release);
        });
        sources.readbacks.push_back(Readback { buffer, state, measures, lights });
    }
}

impl SourceLink {
    /// Tells the world what a readback says.
    fn take(&mut self, readback: &Readback, world: &mut LightWorld) {
        let Readback { buffer, measures, lights, .. } = readback;
        let end = measures.bytes + lights.iter().map(|lights| lights.bytes).sum::<u64>();
        let Some(bytes) = buffer.slice(..end).get_mapped_range().view() else { return };
        let mut at = measures.bytes as usize;
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

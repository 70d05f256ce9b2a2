//! Trees whose lights kernels of the engine write: the bind group of these kernels, and what is read back.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use super::source_link::{
    Fate, IS_LOST, IS_READABLE, LIGHT_BYTES_PER_FRAME, MAX_READ, MAX_WAITING, MEASURED_PER_FRAME,
    PART_RANGES_PER_FRAME, PARTS_PER_FRAME, Readback, WAITS,
};
use super::{GpuLights, memory};
use crate::plan::{BufferId, PartReadback, wgsl_of_sources};
use crate::world::LightWorld;

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
    /// Each build of the top level refits these trees, measures 32 of them, and copies 32 bytes for each into a
    /// buffer that is read some frames later; nothing waits for the GPU. It also copies where 2,048 of their parts are,
    /// 80 bytes each, in at most 32 ranges, so that the top level has nodes where kernels have moved them. Trees whose
    /// policies request a rebuild have their lights copied too, at most 4 MiB a frame or one tree. The world then holds
    /// these lights, and rebuilds the tree within its budget. O(trees that were measured, parts and lights that were
    /// copied).
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
        let (mut bytes, mut parts, mut lights) = (measures.bytes, Vec::new(), Vec::new());
        let mut left = PARTS_PER_FRAME;
        while left > 0
            && parts.len() < PART_RANGES_PER_FRAME
            && let Some(some) = planner.source_parts(left)
            // Otherwise all parts are read back in this frame.
            && parts.first().is_none_or(|first: &PartReadback| first.offset != some.offset)
        {
            bytes += some.bytes;
            left -= some.len();
            parts.push(some);
        }
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
        let ranges = ranges.chain(parts.iter().map(|p| (p.buffer, p.offset, p.bytes)));
        for (from, offset, bytes) in ranges.chain(lights.iter().map(|l| (l.buffer, l.offset, l.bytes))) {
            encoder.copy_buffer_to_buffer(player.buffer(from), offset, &buffer, at, Some(bytes));
            at += bytes;
        }
        let state = Arc::new(AtomicU8::new(WAITS));
        let fate = Fate(Arc::clone(&state));
        encoder.map_buffer_on_submit(&buffer, wgpu::MapMode::Read, 0..at, move |result| {
            fate.0.store(if result.is_ok() { IS_READABLE } else { IS_LOST }, Ordering::Release);
        });
        sources.readbacks.push_back(Readback { buffer, state, measures, parts, lights });
    }
}

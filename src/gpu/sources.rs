//! Trees whose lights kernels of the engine write: the bind group of these kernels, and what is read back.

use super::bindings::bind;
use super::fate::{Fate, Watch};
use super::source_link::{
    Copies, LIGHT_BYTES_PER_FRAME, MAX_READ, MAX_WAITING, MEASURED_PER_FRAME, PART_RANGES_PER_FRAME, PARTS_PER_FRAME,
};
use super::{GpuLights, memory};
use crate::plan::layout::TreeRecord;
use crate::plan::{Readback, wgsl_of_sources};
use crate::world::LightWorld;

/// The bytes of a part that is read back.
const PART_BYTES: u64 = size_of::<TreeRecord>() as u64;

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
            let bound = buffers.map(|id| self.player.buffer(id));
            let group = bind(&self.device, "girandole sources", &self.sources.layout, &bound);
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
        while let Some(fate) =
            self.sources.copies.front().map(|copies| copies.watch.fate()).filter(|f| *f != Fate::Waits)
            && let Some(copies) = self.sources.copies.pop_front()
        {
            if fate == Fate::Done {
                self.sources.take(&copies, world);
                copies.buffer.unmap();
                self.sources.spare = Some(copies.buffer);
            }
        }
    }

    /// Records copies of what the refit found out, and of lights that are wanted.
    pub(super) fn record_readback(&mut self, encoder: &mut wgpu::CommandEncoder) {
        let Self { planner, player, sources, device, .. } = self;
        if sources.copies.len() >= MAX_WAITING {
            return;
        }
        sources.next = if sources.next < planner.source_count() { sources.next } else { 0 };
        let Some(measures) = planner.measures(sources.next, MEASURED_PER_FRAME) else { return };
        sources.next += MEASURED_PER_FRAME;
        let mut ranges: Vec<Readback> = Vec::new();
        let mut left = u64::from(PARTS_PER_FRAME) * PART_BYTES;
        while left > 0
            && ranges.len() < PART_RANGES_PER_FRAME
            && let Some(parts) = planner.source_parts((left / PART_BYTES) as u32)
            // Otherwise all parts are read back in this frame.
            && ranges.first().is_none_or(|first| first.offset != parts.offset)
        {
            left -= parts.bytes;
            ranges.push(parts);
        }
        ranges.push(measures);
        let bytes_of = |ranges: &[Readback]| ranges.iter().map(|range| range.bytes).sum::<u64>();
        let (underway, others) = (sources.underway(), ranges.len());
        while underway + ranges.len() - others < MAX_READ
            && let Some(tree) = sources.wanted.front()
        {
            let lights = planner.source_lights(*tree);
            let bytes = bytes_of(&ranges) + bytes_of(lights.as_slice());
            if ranges.len() > others && bytes > LIGHT_BYTES_PER_FRAME {
                break;
            }
            ranges.extend(lights);
            sources.wanted.pop_front();
        }
        let bytes = bytes_of(&ranges);
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let spare = sources.spare.take().filter(|spare| spare.size() >= bytes);
        let made = || memory::create_buffer(device, "readback", bytes.next_power_of_two(), usage);
        // Without memory, the trees ask again.
        let Some(buffer) = spare.map_or_else(|| made().ok(), Some) else { return };
        let mut at = 0;
        for Readback { buffer: from, offset, bytes, .. } in &ranges {
            encoder.copy_buffer_to_buffer(player.buffer(*from), *offset, &buffer, at, Some(*bytes));
            at += bytes;
        }
        let (watch, traveller) = Watch::new();
        encoder.map_buffer_on_submit(&buffer, wgpu::MapMode::Read, 0..at, move |result| {
            traveller.arrive(result.is_ok());
        });
        sources.copies.push_back(Copies { buffer, watch, ranges });
    }
}

//! Cuts that neighbours share, on the GPU: shaders mark the cells of their shading points, kernels build a cut
//! for each cell, and other shaders of the same frame choose lights from these.
//!
//! docs/cuts.md says when to use them.

mod kernels;
mod places;
mod table;

use std::sync::OnceLock;

use glam::DVec3;

pub(super) use kernels::CutKernels;
use table::CutBuffers;
pub(super) use table::SharedCuts;

use super::GpuLights;
use super::error::GpuError;
use super::shader::LightShader;
use crate::effects::Effects;
use crate::plan::cut_fallback::CutFallback;
use crate::sampling::cuts::{CutOptions, camera};

impl GpuLights {
    /// Makes a table of cuts that neighbours share, or drops the present one for `None`. Before the first
    /// call there is none.
    ///
    /// Takes 1.4 kB of GPU memory for each cell that may have a cut, and 256 to 512 bytes for its places
    /// for marked cells. [`CutTable`](crate::CutTable) says what cuts are good for;
    /// the GPU does the same. A frame has these steps:
    ///
    /// 1. [`GpuLights::sync`], and [`GpuLights::set_cut_view`].
    /// 2. A pass of the engine that knows the frame's shading points calls `light_mark` for each of them:
    ///    see [`GpuLights::mark_shader`].
    /// 3. [`GpuLights::build_cuts`].
    /// 4. The engine's other shaders choose lights: see [`GpuLights::cut_shader`].
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`]; the present table stays.
    pub fn share_cuts(&mut self, options: Option<CutOptions>) -> Result<(), GpuError> {
        if options.is_none() && self.cuts.get().is_none() {
            return Ok(());
        }
        self.shared_cuts();
        let (device, queue, origin, zeros) = (self.device.clone(), self.queue.clone(), self.origin, self.no_cuts());
        let Some(cuts) = self.cuts.get_mut() else { return Ok(()) };
        let result = match options {
            Some(options) => cuts.start((&device, &queue), options, origin),
            None => {
                cuts.stop(&device, zeros);
                Ok(())
            }
        };
        self.rebind_cuts();
        result
    }

    /// Makes cells follow the pixels of a camera for all marks to come, as
    /// [`CutTable::set_view`](crate::CutTable::set_view) does. Does nothing without a table. Written ahead of
    /// the next submission.
    pub fn set_cut_view(&mut self, eye: DVec3, pixel: f32) {
        if let Some(cuts) = self.cuts.get_mut() {
            cuts.set_camera(&self.queue, camera(eye, pixel));
        }
    }

    /// Returns the text and the layout for a shader that marks the cells of shading points. It has the
    /// functions that make shading points, as [`LightShader`] lists them, and
    ///
    /// ```wgsl
    /// // Marks the cell of a shading point: it will have a cut from the next build on.
    /// fn light_mark(shading_point: LightShadingPoint)
    /// ```
    ///
    /// Call it for all points, or for a random part of them if
    /// [`CutOptions::with_min_marks`](crate::CutOptions::with_min_marks) is lower by the same factor. Segments, and
    /// glossy points that the camera does not see, are not marked. The cost is two atomic operations.
    ///
    /// The text binds one uniform and one storage buffer, which it writes:
    /// [`GpuLights::mark_bind_group`]. In fragment shaders it needs
    /// `wgpu::DownlevelFlags::FRAGMENT_WRITABLE_STORAGE`.
    pub fn mark_shader(&self, group: u32, effects: Effects) -> LightShader {
        LightShader::marking(group, effects, self.shared_cuts().mark_layout.clone())
    }

    /// The bind group for a [`GpuLights::mark_shader`]. [`GpuLights::share_cuts`] replaces it.
    pub fn mark_bind_group(&self) -> &wgpu::BindGroup {
        &self.shared_cuts().mark_bind_group
    }

    /// As [`GpuLights::shader`], for lights that are chosen from the cuts of cells. `fallback` is what
    /// happens where a cell has no cut: because the table has no room for it, because it was marked too
    /// rarely or not at all, or because the world changed after the last build of the cuts. All
    /// probabilities stay exact.
    ///
    /// The layout has one more uniform buffer and one more storage buffer, which is only read: five of the
    /// eight storage buffers that WebGPU grants a stage. It takes
    /// [`GpuLights::cut_bind_group`] in place of [`GpuLights::bind_group`]. `light_pmf_previous`
    /// ([`LightShader::with_previous`]) leaves shared cuts out. [`GpuLights::sample`] and
    /// [`GpuLights::resample`] do not use them.
    pub fn cut_shader(&self, group: u32, effects: Effects, fallback: CutFallback) -> LightShader {
        LightShader::choosing(group, effects, false, Some(fallback), self.shared_cuts().layout.clone())
    }

    /// The bind group for a [`GpuLights::cut_shader`]. Call this in each frame after
    /// [`GpuLights::upload`], as for [`GpuLights::bind_group`], and after [`GpuLights::share_cuts`].
    pub fn cut_bind_group(&self) -> &wgpu::BindGroup {
        &self.shared_cuts().bind_group
    }

    /// Records passes that build the cuts of all cells that were marked, and forget the marks. Record
    /// them after [`GpuLights::build_top`] and the passes that mark, ahead of those that choose lights.
    /// Does nothing without a table. Cuts suit glossy points if the world's lights are
    /// sampled for these: see [`LightWorld::set_glossy_sampling`](crate::LightWorld::set_glossy_sampling).
    ///
    /// Cells keep their cuts while nothing is uploaded, unless more points of them are known now. Which
    /// cells are refused, if there are too many, depends on the order in which the GPU works.
    ///
    /// Three dispatches: one for the places of the table, one for a single invocation, and one of a
    /// workgroup for each cell that is built. The first call compiles their pipelines and waits for them, and so
    /// does the first call after [`GpuLights::effects`] have changed to a set that is new.
    pub fn build_cuts(&mut self, encoder: &mut wgpu::CommandEncoder) {
        if self.is_dark {
            return;
        }
        let effects = self.effects();
        let Some(mut cuts) = self.cuts.take() else { return };
        let buffers = cuts.buffers.clone();
        if let Some(parts) = cuts.build(&self.queue) {
            let mut kernels = self.cut_kernels.take().unwrap_or_else(|| CutKernels::new(&self.device));
            kernels.record(&self.device, encoder, effects, (&self.buffers(), &buffers), &parts);
            self.cut_kernels = Some(kernels);
        }
        self.cuts = OnceLock::from(cuts);
    }

    /// A buffer of the counters of the last build, which may be copied and read; `None` without a table.
    ///
    /// Words 4 to 9 are the fields of [`CutReport`](crate::CutReport) in their order; the others belong to the
    /// library.
    pub fn cut_report(&self) -> Option<&wgpu::Buffer> {
        self.cuts.get()?.report()
    }

    /// Two buffers of zeros in place of a table.
    fn no_cuts(&self) -> CutBuffers {
        CutBuffers { grid: self.dark.params.clone(), table: self.dark.records.clone() }
    }

    /// Makes the layouts and bind groups without a table when they are first needed.
    fn shared_cuts(&self) -> &SharedCuts {
        self.cuts.get_or_init(|| SharedCuts::new(&self.device, self.no_cuts(), &self.buffers()))
    }

    /// Makes cuts void that were built for what the buffers held before. Returns the bytes sent.
    pub(super) fn make_cuts_void(&self) -> u64 {
        self.cuts.get().map_or(0, |cuts| cuts.make_void(&self.queue))
    }

    /// Replaces the bind group with the table if a buffer of it was replaced.
    pub(super) fn rebind_cuts(&mut self) {
        let Some(mut cuts) = self.cuts.take() else { return };
        cuts.rebind(&self.device, &self.buffers(), self.bound);
        self.cuts = OnceLock::from(cuts);
    }
}

#[cfg(test)]
mod tests;

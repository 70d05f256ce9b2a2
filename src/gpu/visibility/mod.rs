//! Learnt visibility on the GPU: shaders record what shadow rays found, a kernel folds the records
//! into a table once a frame, and the next frame's choices read it.
//!
//! Shaders that learn have bindings of their own. They are no variant of the others: a shader that reads a table could not run with the bind group of lights
//! that have none, and every other shader would have to bind a table that it does not read.

mod table;

use std::sync::OnceLock;

use glam::DVec3;

pub(super) use table::LearntTable;

use super::GpuLights;
use super::error::GpuError;
use super::shader::LightShader;
use crate::effects::Effects;
use crate::visibility::VisibilityOptions;

impl GpuLights {
    /// Makes a table of learnt visibility that knows nothing, or drops the present one for `None`.
    /// Before the first call there is none.
    ///
    /// Takes 1.7 kB of GPU memory for each cell. [`VisibilityTable`](crate::VisibilityTable) says
    /// when to use one, what it learns and how it forgets; the GPU does the same.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`]; the present table stays.
    pub fn learn_visibility(&mut self, options: Option<VisibilityOptions>) -> Result<(), GpuError> {
        if options.is_none() && self.learnt.get().is_none() {
            return Ok(());
        }
        self.learnt_table();
        let (device, queue, origin) = (self.device.clone(), self.queue.clone(), self.origin);
        let Some(mut learnt) = self.learnt.take() else { return Ok(()) };
        let result = match options {
            Some(options) => learnt.start((&device, &queue), options, origin),
            None => {
                learnt.stop(self.dark.storage.clone(), self.dark.records.clone());
                Ok(())
            }
        };
        self.learnt = OnceLock::from(learnt);
        self.rebind_visibility();
        result
    }

    /// As [`GpuLights::shader`], for lights that are chosen by learnt visibility too, with one more
    /// function:
    ///
    /// ```wgsl
    /// // Records whether a light that light_sample chose for this shading point is visible: whether
    /// // a shadow ray to the chosen point met nothing.
    /// fn light_record_visibility(shading_point: LightShadingPoint, chosen: LightSample, is_visible: bool)
    /// ```
    ///
    /// Call it for all samples, or for a random part of them. Samples with a pmf of 0 and
    /// directional lights may be passed and are not recorded. The cost is one node and one atomic
    /// addition for each level above the light. All functions that choose lights and return
    /// probabilities use the table, which does not change before [`GpuLights::fold_visibility`]: so
    /// all probabilities of a frame are exact.
    ///
    /// The layout has two more storage buffers, of which one is written. It takes
    /// [`GpuLights::visibility_bind_group`] in place of [`GpuLights::bind_group`]. In fragment
    /// shaders it needs `wgpu::DownlevelFlags::FRAGMENT_WRITABLE_STORAGE`, which every WebGPU
    /// device has. Without a table (before
    /// [`GpuLights::learn_visibility`]), lights are chosen as by other shaders.
    /// [`GpuLights::sample`] and [`GpuLights::resample`] do not use the table.
    pub fn visibility_shader(&self, group: u32, effects: Effects) -> LightShader {
        LightShader::choosing(group, effects, true, None, self.learnt_table().layout.clone())
    }

    /// The bind group for a [`GpuLights::visibility_shader`]. Call this in each frame after
    /// [`GpuLights::upload`], as for [`GpuLights::bind_group`], and after
    /// [`GpuLights::learn_visibility`].
    pub fn visibility_bind_group(&self) -> &wgpu::BindGroup {
        &self.learnt_table().bind_group
    }

    /// Records a pass that makes what was recorded part of the table. Call it once a frame, after
    /// the passes that record. Does nothing without a table.
    ///
    /// One dispatch, of a workgroup for each cell of the table; most end at once.
    pub fn fold_visibility(&mut self, encoder: &mut wgpu::CommandEncoder) {
        if let Some(learnt) = self.learnt.get() {
            learnt.fold(&self.device, encoder);
        }
    }

    /// Takes the origin of the world that is uploaded. Returns the bytes sent.
    pub(super) fn follow_origin(&mut self, origin: DVec3) -> u64 {
        self.origin = origin;
        self.learnt.get_mut().map_or(0, |learnt| learnt.set_origin(&self.queue, origin))
    }

    /// Makes the layout and a bind group without a table when they are first needed.
    fn learnt_table(&self) -> &LearntTable {
        self.learnt.get_or_init(|| {
            LearntTable::new(&self.device, self.dark.storage.clone(), self.dark.records.clone(), &self.buffers())
        })
    }

    /// Replaces the bind group with the table if a buffer of it was replaced.
    pub(super) fn rebind_visibility(&mut self) {
        let Some(mut learnt) = self.learnt.take() else { return };
        learnt.rebind(&self.device, &self.buffers(), self.bound);
        self.learnt = OnceLock::from(learnt);
    }
}

#[cfg(test)]
mod tests;

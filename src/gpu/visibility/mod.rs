//! Learnt visibility on wgpu: plans fold what shaders record.
//!
//! Shaders that learn have bindings of their own. They are no variant of the others: a shader that reads a table
//! could not run with the bind group of lights that have none, and every other shader would have to bind a table
//! that it does not read.

use super::GpuLights;
use super::error::GpuError;
use super::recorder::Recorder;
use super::shader::LightShader;
use super::table_groups::Tables;
use crate::effects::Effects;
use crate::plan::ShaderParts;
use crate::visibility::VisibilityOptions;

impl GpuLights {
    /// Makes a table of learnt visibility that knows nothing, or drops the present one for `None`.
    /// Before the first call there is none.
    ///
    /// Takes 7.5 kB of GPU memory for each cell. [`VisibilityTable`](crate::VisibilityTable) says
    /// when to use one, what it learns and how it forgets; the GPU does the same.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`], [`GpuError::DeviceLost`], and [`GpuError::Full`] if the device cannot bind so many
    /// cells. The present table stays.
    pub fn learn_visibility(&mut self, options: Option<VisibilityOptions>) -> Result<(), GpuError> {
        if options.is_none() && self.planner.visibility_table().is_none() {
            return Ok(());
        }
        self.replace_table(|planner| planner.reserve_visibility(options))
    }

    /// As [`GpuLights::shader`], for lights that are chosen by learnt visibility too, and with
    /// `light_record_visibility`: see [`ShaderParts::learns`]. The table does not change before
    /// [`GpuLights::fold_visibility`].
    ///
    /// The layout has two more storage buffers, of which one is written. It takes
    /// [`GpuLights::visibility_bind_group`] in place of [`GpuLights::bind_group`]. In fragment
    /// shaders it needs `wgpu::DownlevelFlags::FRAGMENT_WRITABLE_STORAGE`, which every WebGPU
    /// device has. Without a table (before
    /// [`GpuLights::learn_visibility`]), lights are chosen as by other shaders.
    /// [`GpuLights::sample`] and [`GpuLights::resample`] do not use the table.
    pub fn visibility_shader(&self, group: u32, effects: Effects) -> LightShader {
        LightShader::choosing(
            group,
            effects,
            ShaderParts::default().with_learning(),
            self.table_group(Tables::Visibility).layout.clone(),
        )
    }

    /// The bind group for a [`GpuLights::visibility_shader`]. Call this in each frame after
    /// [`GpuLights::upload`], as for [`GpuLights::bind_group`], and after
    /// [`GpuLights::learn_visibility`].
    pub fn visibility_bind_group(&self) -> &wgpu::BindGroup {
        &self.table_group(Tables::Visibility).bind_group
    }

    /// Records the commands of [`LightPlanner::fold_visibility`](crate::plan::LightPlanner::fold_visibility): what
    /// was recorded becomes part of the table. Call it once a frame, after the passes that record. Does nothing
    /// without a table.
    pub fn fold_visibility(&mut self, encoder: &mut wgpu::CommandEncoder) {
        let commands = self.planner.fold_visibility();
        self.player.record(&mut Recorder::together(encoder, "girandole visibility"), &commands);
    }
}

#[cfg(test)]
mod tests;

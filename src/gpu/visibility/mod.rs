//! Learnt visibility on wgpu: plans fold what shaders record.

use super::GpuLights;
use super::error::GpuError;
use super::recorder::Recorder;
use crate::visibility::VisibilityOptions;

impl GpuLights {
    /// Makes a table of learnt visibility that knows nothing, or drops the present one for `None`.
    /// Before the first call there is none.
    ///
    /// Takes 7.5 kB of GPU memory for each cell. [`VisibilityTable`](crate::VisibilityTable) says
    /// when to use one, what it learns and how it forgets; the GPU does the same. Shaders record with
    /// [`GpuLights::learning_cut_shader`].
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

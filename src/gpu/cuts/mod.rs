//! Cuts that neighbours share, on wgpu: plans fill and build the table, and this binds it.

use glam::DVec3;

use super::GpuLights;
use super::error::GpuError;
use super::recorder::Recorder;
use super::shader::LightShader;
use super::table_groups::Tables;
use crate::effects::Effects;
use crate::plan::ShaderParts;
use crate::sampling::cuts::CutOptions;

impl GpuLights {
    /// Makes a table of cuts that neighbours share, or drops the present one for `None`. Before the first
    /// call there is none.
    ///
    /// Takes 1.7 kB of GPU memory for each cell that may have a cut, and 256 to 512 bytes for its places
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
    /// [`GpuError::OutOfMemory`], [`GpuError::DeviceLost`], and [`GpuError::Full`] if the device cannot bind so many
    /// cells. The present table stays.
    pub fn share_cuts(&mut self, options: Option<CutOptions>) -> Result<(), GpuError> {
        if options.is_none() && self.planner.cut_table().is_none() {
            return Ok(());
        }
        self.replace_table(|planner| planner.reserve_cuts(options))
    }

    /// Makes cells follow the pixels of a camera for all marks to come, as
    /// [`CutTable::set_view`](crate::CutTable::set_view) does. Does nothing without a table. Written ahead of
    /// the next submission.
    pub fn set_cut_view(&mut self, eye: DVec3, pixel: f32) {
        let commands = self.planner.set_cut_view(eye, pixel);
        self.player.play(&commands);
    }

    /// Returns the text and the layout for a shader that marks the cells of shading points: the functions that make
    /// these, as [`LightShader`] lists them, and `light_mark` ([`wgsl_of_marks`](crate::plan::wgsl_of_marks)).
    ///
    /// The text binds one storage buffer, which it writes: [`GpuLights::mark_bind_group`]. In fragment shaders it
    /// needs `wgpu::DownlevelFlags::FRAGMENT_WRITABLE_STORAGE`.
    pub fn mark_shader(&self, group: u32, effects: Effects) -> LightShader {
        LightShader::marking(group, effects, self.table_group(Tables::Marks).layout.clone())
    }

    /// The bind group for a [`GpuLights::mark_shader`]. [`GpuLights::share_cuts`] replaces it.
    pub fn mark_bind_group(&self) -> &wgpu::BindGroup {
        &self.table_group(Tables::Marks).bind_group
    }

    /// As [`GpuLights::shader`], for lights that are chosen from the cuts of cells
    /// ([`ShaderParts::cuts`]).
    ///
    /// The layout has one more storage buffer, which is only read: five of the eight that WebGPU grants a
    /// stage. It takes [`GpuLights::cut_bind_group`] in place of [`GpuLights::bind_group`].
    /// `light_pmf_previous` ([`LightShader::with_previous`]) leaves shared cuts out. [`GpuLights::sample`]
    /// and [`GpuLights::resample`] do not use them.
    pub fn cut_shader(&self, group: u32, effects: Effects) -> LightShader {
        LightShader::choosing(
            group,
            effects,
            ShaderParts::default().with_cuts(),
            self.table_group(Tables::Cuts).layout.clone(),
        )
    }

    /// The bind group for a [`GpuLights::cut_shader`]. Call this in each frame after
    /// [`GpuLights::upload`], as for [`GpuLights::bind_group`], and after [`GpuLights::share_cuts`].
    pub fn cut_bind_group(&self) -> &wgpu::BindGroup {
        &self.table_group(Tables::Cuts).bind_group
    }

    /// As [`GpuLights::cut_shader`], and the text has `light_record_visibility` ([`ShaderParts::learns`]). It takes
    /// [`GpuLights::learning_cut_bind_group`], with seven storage buffers, of which the text writes one: fragment
    /// shaders need `wgpu::DownlevelFlags::FRAGMENT_WRITABLE_STORAGE`.
    ///
    /// Both shaders read the same cells, which are built by the table of [`GpuLights::learn_visibility`].
    /// `light_resample` weighs candidates by learnt shares in this shader only. The table does not change before
    /// [`GpuLights::fold_visibility`].
    pub fn learning_cut_shader(&self, group: u32, effects: Effects) -> LightShader {
        LightShader::choosing(
            group,
            effects,
            ShaderParts::default().with_learning(),
            self.table_group(Tables::CutsAndVisibility).layout.clone(),
        )
    }

    /// The bind group for a [`GpuLights::learning_cut_shader`]. Call this when you would call
    /// [`GpuLights::cut_bind_group`], and after [`GpuLights::learn_visibility`].
    pub fn learning_cut_bind_group(&self) -> &wgpu::BindGroup {
        &self.table_group(Tables::CutsAndVisibility).bind_group
    }

    /// Records the commands of [`LightPlanner::build_cuts`](crate::plan::LightPlanner::build_cuts) in one pass: the
    /// build of the cuts of all cells that were marked. Record it after
    /// [`GpuLights::build_top`] and the passes that mark, ahead of those that choose lights. Does nothing
    /// without a table.
    ///
    /// The first call compiles five pipelines and waits for them. It compiles one more at the first call with learnt
    /// visibility, and for each new set of [`GpuLights::effects`].
    pub fn build_cuts(&mut self, encoder: &mut wgpu::CommandEncoder) {
        if self.is_dark {
            return;
        }
        let commands = self.planner.build_cuts();
        self.player.record(&mut Recorder::together(encoder, "girandole cuts"), &commands);
    }

    /// A buffer of the counters of the last build, which may be copied and read: see
    /// [`LightPlanner::cut_report`](crate::plan::LightPlanner::cut_report). `None` without a table.
    pub fn cut_report(&self) -> Option<&wgpu::Buffer> {
        self.planner.cut_report().map(|report| self.player.buffer(report))
    }
}

#[cfg(test)]
mod tests;

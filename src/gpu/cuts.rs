//! Cells on wgpu: plans build their cuts, and fold what they learn.

use glam::DVec3;

use super::GpuLights;
use super::error::GpuError;
use super::options::GpuOptions;
use super::player::labelled;

impl GpuLights {
    /// Makes cells follow the pixels of a camera for all marks to come, as
    /// [`CutTable::set_view`](crate::CutTable::set_view) does. Call it in each frame in which the camera has moved.
    /// Without it all cells have the same size. Written ahead of the next submission.
    ///
    /// Views of several cameras may share the cells of one of them, such as the player's.
    pub fn set_cut_view(&mut self, eye: DVec3, pixel: f32) {
        let commands = self.planner.set_cut_view(eye, pixel);
        self.player.play(&commands);
    }

    /// Records the commands of [`LightPlanner::build_cuts`](crate::plan::LightPlanner::build_cuts) in one pass: what
    /// shadow rays found becomes part of what is learnt, and all cells that were marked since the last call get cuts.
    ///
    /// [`GpuLights::sync`] does this, so most engines need not call it. An engine with a pass that knows the shading
    /// points of a frame, as one with a G-buffer, may mark them there and call this between that pass and those that
    /// choose lights: then new cells have cuts in their first frame. The next `sync` leaves the build out.
    ///
    /// The first call compiles five pipelines and waits for them, or eight where cells learn. It compiles one more
    /// for each new set of [`GpuLights::effects`].
    pub fn build_cuts(&mut self, encoder: &mut wgpu::CommandEncoder) {
        self.has_built_cuts = true;
        self.record_cuts(encoder);
    }

    /// Records the build.
    pub(super) fn record_cuts(&mut self, encoder: &mut wgpu::CommandEncoder) {
        if self.is_dark {
            return;
        }
        let commands = self.planner.build_cuts();
        self.player.record(encoder, &labelled("girandole cuts"), commands.iter());
    }

    /// Forgets what was learnt about visibility, as after a cut to another scene. Does nothing without
    /// [`GpuOptions::learning`]. Written ahead of the next submission.
    pub fn forget_visibility(&mut self) {
        let commands = self.planner.forget_visibility();
        self.player.play(&commands);
    }

    /// A buffer of the counters of the last build, which may be copied and read: see
    /// [`LightPlanner::cut_report`](crate::plan::LightPlanner::cut_report). `None` only for a lost device.
    pub fn cut_report(&self) -> Option<&wgpu::Buffer> {
        self.planner.cut_report().map(|report| self.player.buffer(report))
    }

    /// Makes the table of cells.
    pub(super) fn make_cells(&mut self, options: &GpuOptions) -> Result<(), GpuError> {
        let reservation = self.planner.reserve_cells(options.cuts, options.learning);
        self.player.create(reservation.new_buffers())?;
        self.player.play(&reservation.plan().upload);
        Ok(())
    }
}

#[cfg(test)]
mod learning_tests;
#[cfg(test)]
mod tests;

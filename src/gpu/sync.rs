//! One call for a frame.

use super::GpuLights;
use super::error::GpuError;
use crate::plan::UploadReport;
use crate::scheduler::FrameBudget;
use crate::world::{FrameReport, LightWorld};

/// What [`GpuLights::sync`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SyncReport {
    /// What the update of the world did.
    pub frame: FrameReport,
    /// What was sent to the GPU.
    pub upload: UploadReport,
}

impl GpuLights {
    /// Brings the GPU up to date with the edits of `world`: updates the world
    /// ([`LightWorld::update`]), uploads what changed ([`GpuLights::upload`]), and records the build
    /// of the top level into `encoder` ([`GpuLights::build_top`]). Call it once a frame, before the
    /// passes that sample. No delta can be forgotten.
    ///
    /// Submit the encoder before the next call.
    ///
    /// # Errors
    /// As [`GpuLights::upload`]. The world was updated, nothing was recorded, and the changes are
    /// sent with the next call.
    pub fn sync(
        &mut self,
        world: &mut LightWorld,
        budget: FrameBudget,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<SyncReport, GpuError> {
        let frame = world.update(budget);
        let delta = world.take_delta();
        let upload = self.upload(world, &delta)?;
        self.build_top(encoder);
        Ok(SyncReport { frame, upload })
    }
}

//! One call for a frame.

use super::GpuLights;
use super::error::GpuError;
use crate::plan::UploadReport;
use crate::scheduler::FrameBudget;
use crate::world::{FrameReport, LightWorld, Revision};

/// What [`GpuLights::sync`] did.
///
/// A renderer that keeps samples from frame to frame reads what became of their instances:
///
/// ```
/// use girandole::gpu::SyncReport;
/// use girandole::{LightWorld, glam::DVec3};
///
/// /// `kept` are positions relative to the origin.
/// fn follow(world: &LightWorld, report: &SyncReport, kept: &mut [DVec3]) {
///     let changes = world.changes_since(report.since);
///     for slot in changes.moved_instances() { /* Weigh its samples less. */ }
///     for slot in changes.removed_instances() { /* Drop its samples. */ }
///     if let Some(shift) = changes.origin_shift() {
///         kept.iter_mut().for_each(|position| *position -= shift);
///     }
/// }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SyncReport {
    /// What the update of the world did.
    pub frame: FrameReport,
    /// What was sent to the GPU.
    pub upload: UploadReport,
    /// The revision that the GPU followed the world from: that of the last call that succeeded.
    ///
    /// [`LightWorld::changes_since`] lists the instances that were moved, added and removed since
    /// then, and how far the origin moved.
    pub since: Revision,
}

impl GpuLights {
    /// Brings the GPU up to date with the edits of `world`: updates the world
    /// ([`LightWorld::update`]), uploads what changed ([`GpuLights::upload`]), and records into `encoder` the build
    /// of the top level ([`GpuLights::build_top`]) and, unless the engine has built them since the last call, of the cuts
    /// of cells that were marked ([`GpuLights::build_cuts`]). Call it once a frame, before the passes that sample.
    ///
    /// Submit the encoder before the next call.
    ///
    /// An engine whose kernels write [lights](GpuLights::source_group) makes these calls by itself, after
    /// [`GpuLights::follow_sources`], and records its kernels before [`GpuLights::build_top`].
    ///
    /// # Errors
    /// As [`GpuLights::upload`]. The world was updated and nothing was recorded. The next call sends the
    /// changes too, and its report covers them.
    pub fn sync(
        &mut self,
        world: &mut LightWorld,
        budget: FrameBudget,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<SyncReport, GpuError> {
        self.follow_sources(world);
        let frame = world.update(budget);
        let since = self.revision();
        let upload = self.upload(world)?;
        self.build_top(encoder);
        if !std::mem::take(&mut self.has_built_cuts) {
            self.record_cuts(encoder);
        }
        Ok(SyncReport { frame, upload, since })
    }
}

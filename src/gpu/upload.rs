//! Brings the GPU's buffers up to date with a world.

use super::GpuLights;
use super::error::GpuError;
use super::memory;
use super::probe;
use crate::plan::UploadReport;
use crate::plan::draft::Growth;
use crate::span::span;
use crate::world::LightWorld;

impl GpuLights {
    /// Sends what changed in `world` since the last upload ([`GpuLights::revision`]), however long ago
    /// that was. The first upload sends everything.
    ///
    /// Writes go through the queue, ahead of the next submission. O(what changed); an upload without
    /// changes sends nothing.
    ///
    /// # Errors
    /// The next upload sends what an upload that fails has not sent.
    ///
    /// - [`GpuError::Full`] if a buffer would outgrow what the device can bind. Nothing was
    ///   written. Later uploads succeed once the world holds less.
    /// - [`GpuError::OutOfMemory`] if the device has no memory left. Shaders keep reading what
    ///   they read before, or sample no light, as documented there. If they sample none, the next upload
    ///   also empties the tables of shared cuts and of learnt visibility.
    /// - [`GpuError::DeviceLost`] from the first call after wgpu noticed the loss. In browsers
    ///   only the engine's own `set_device_lost_callback` reports it.
    pub fn upload(&mut self, world: &LightWorld) -> Result<UploadReport, GpuError> {
        span!("upload");
        probe::check(&self.device)?;
        let (device, revision) = (self.device.clone(), self.revision());
        let (result, is_refused) = memory::watch(&device, || self.send(world));
        if is_refused {
            // Some write or copy did not happen, and wgpu does not report which.
            self.planner.lose();
            self.planner.rewind(revision);
            self.make_dark();
            let bytes = result.map_or(0, |report| report.bytes);
            return Err(GpuError::OutOfMemory { what: "uploaded records", bytes });
        }
        result
    }

    /// Makes all buffers, and only then changes what shaders read.
    fn send(&mut self, world: &LightWorld) -> Result<UploadReport, GpuError> {
        let result = self.try_send(world, Growth::Double);
        if !matches!(result, Err(GpuError::OutOfMemory { .. })) {
            return result;
        }
        // Buffers without spare room may still fit.
        self.try_send(world, Growth::Exact).or(result)
    }

    fn try_send(&mut self, world: &LightWorld, growth: Growth) -> Result<UploadReport, GpuError> {
        let Self { planner, player, .. } = self;
        let reservation = planner.reserve_as(world, growth)?;
        player.create(reservation.new_buffers())?;
        let plan = reservation.plan();
        player.play(&plan.upload);
        self.is_dark = false;
        self.rebind();
        // Bind groups that are still in use keep the former buffers.
        self.player.free(&plan.freed);
        if !plan.top.is_empty() {
            self.top = plan.top;
            self.top_status.invalidate();
        }
        Ok(plan.report)
    }
}

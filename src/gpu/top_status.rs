//! Keeps track of whether the top level must be built.

use super::fate::{Fate, Watch};

/// Whether a build of the top level is due: the buffers have changed since the last one, or the
/// commands of the last one were dropped before they were submitted.
#[derive(Debug)]
pub(super) struct TopStatus {
    /// The buffers have changed since the last build was recorded.
    is_stale: bool,
    /// Over the commands of the last build.
    watch: Watch,
}

impl TopStatus {
    /// Nothing is built yet.
    pub fn new() -> Self {
        Self { is_stale: true, watch: Watch::default() }
    }

    /// To be called when the buffers that a build reads have changed.
    pub fn invalidate(&mut self) {
        self.is_stale = true;
    }

    /// Whether a build must be recorded.
    pub fn needs_build(&self) -> bool {
        self.is_stale || self.watch.fate() == Fate::Lost
    }

    /// To be called where a build is recorded into `encoder`.
    ///
    /// The commands carry a callback for the end of their work, which costs less than the mapping
    /// of a buffer: two small allocations and no GPU object.
    pub fn record(&mut self, encoder: &wgpu::CommandEncoder) {
        let (watch, traveller) = Watch::new();
        // What happens to earlier builds no longer matters.
        *self = Self { is_stale: false, watch };
        encoder.on_submitted_work_done(move || traveller.arrive(true));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::testing::gpu;

    #[test]
    fn a_build_is_due_until_its_commands_are_submitted() {
        let (device, queue) = gpu();
        let encoder = || device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut status = TopStatus::new();
        assert!(status.needs_build());
        let first = encoder();
        status.record(&first);
        assert!(!status.needs_build(), "the commands may still be submitted");
        drop(first);
        assert!(status.needs_build(), "the encoder was dropped");
        let second = encoder();
        status.record(&second);
        drop(second.finish());
        assert!(status.needs_build(), "the command buffer was dropped");
        let third = encoder();
        status.record(&third);
        queue.submit([third.finish()]);
        assert!(!status.needs_build(), "submitted, and possibly not finished");
        device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
        assert!(!status.needs_build(), "finished");
    }

    #[test]
    fn the_fate_of_an_earlier_build_does_not_matter() {
        let (device, queue) = gpu();
        let encoder = || device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut status = TopStatus::new();
        let [old, new] = [encoder(), encoder()];
        status.record(&old);
        status.invalidate();
        status.record(&new);
        drop(old);
        assert!(!status.needs_build());
        queue.submit([new.finish()]);
        assert!(!status.needs_build());
    }
}

//! Keeps track of whether the top level must be built.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether a build of the top level is due: the buffers have changed since the last one, or the
/// commands of the last one were dropped before they were submitted.
#[derive(Debug)]
pub(super) struct TopStatus {
    /// The buffers have changed since the last build was recorded.
    is_stale: bool,
    /// Set when the commands of the last build are dropped unsubmitted.
    is_dropped: Arc<AtomicBool>,
}

/// Travels with the commands of a build. wgpu drops it with commands that are never submitted, and
/// passes it to the callback for finished work otherwise.
struct RecordedBuild {
    is_dropped: Arc<AtomicBool>,
    is_submitted: bool,
}

impl RecordedBuild {
    fn submitted(mut self) {
        self.is_submitted = true;
    }
}

impl Drop for RecordedBuild {
    fn drop(&mut self) {
        if !self.is_submitted {
            self.is_dropped.store(true, Ordering::Relaxed);
        }
    }
}

impl TopStatus {
    /// Nothing is built yet.
    pub fn new() -> Self {
        Self { is_stale: true, is_dropped: Arc::default() }
    }

    /// To be called when the buffers that a build reads have changed.
    pub fn invalidate(&mut self) {
        self.is_stale = true;
    }

    /// Whether a build must be recorded.
    pub fn needs_build(&self) -> bool {
        self.is_stale || self.is_dropped.load(Ordering::Relaxed)
    }

    /// To be called where a build is recorded into `encoder`.
    ///
    /// The commands carry a callback for the end of their work, which costs less than the mapping
    /// of a buffer: two small allocations and no GPU object.
    pub fn record(&mut self, encoder: &wgpu::CommandEncoder) {
        self.is_stale = false;
        // What happens to earlier builds no longer matters.
        self.is_dropped = Arc::default();
        let build = RecordedBuild { is_dropped: Arc::clone(&self.is_dropped), is_submitted: false };
        encoder.on_submitted_work_done(move || build.submitted());
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

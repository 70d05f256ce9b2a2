//! The plan of one frame.

use super::buffers::{BufferId, NewBuffer};
use super::changes::UploadReport;
use super::commands::Commands;

/// What the GPU has to do in one frame, in this order: make buffers, run two lists of commands, and
/// free buffers. Kernels of the engine that [write lights](super::wgsl_of_sources) run between the two lists.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct FramePlan {
    /// Plans are numbered from 1 on, and have to be played in this order.
    pub number: u64,
    /// The buffers that the plan needs: those of
    /// [`Reservation::new_buffers`](super::Reservation::new_buffers), which the engine has made
    /// already.
    pub new_buffers: Vec<NewBuffer>,
    /// Brings the buffers up to date with the world. Empty if nothing changed.
    pub upload: Commands,
    /// Refits the trees whose lights kernels of the engine write, and builds the top level. Empty if it is up to
    /// date and there are no such trees.
    pub top: Commands,
    /// Buffers that no later plan uses. The commands of this plan may still read them, and so may
    /// commands that the engine recorded earlier.
    pub freed: Vec<BufferId>,
    /// What was sent.
    pub report: UploadReport,
}

impl FramePlan {
    /// Whether there is nothing to do.
    pub fn is_empty(&self) -> bool {
        self.new_buffers.is_empty() && self.upload.is_empty() && self.top.is_empty() && self.freed.is_empty()
    }
}

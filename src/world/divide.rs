//! Keeps the partition of the top level up to date.

use super::LightWorld;
#[cfg(feature = "gpu-plan")]
use super::{KernelPart, TreeVersion};
use crate::top::partition::Partition;

/// A world that was not updated since it had so many times fewer instances is filed when it is read.
const LATE_GROWTH: usize = 2;

impl LightWorld {
    /// How the top level divides space.
    ///
    /// It is that of the last update, unless most instances were added since.
    pub(crate) fn partition(&self) -> &Partition {
        let Self { filing, scene, log, top, .. } = self;
        if scene.instances.len() <= LATE_GROWTH * filing.instances {
            return &filing.partition;
        }
        if let Some(late) = top.late.get() {
            return &late.partition;
        }
        // Outside of the lock, as the top level is built.
        let mut late = filing.fork();
        late.follow(scene, log);
        &top.late.get_or_init(|| late).partition
    }

    /// Takes what was read back of a version of a tree: its parts from `first` on, when it had `count`.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn follow_kernel(&mut self, read: (TreeVersion, u32, usize), parts: impl Iterator<Item = KernelPart>) {
        self.filing.follow_kernel(&self.scene, read, parts);
    }

    /// Brings the partition up to date.
    pub(super) fn renew_partition(&mut self) {
        let Self { filing, scene, log, top, .. } = self;
        let before = filing.partition.number();
        if let Some(late) = top.late.take() {
            *filing = late;
        }
        filing.follow(scene, log);
        if filing.partition.number() != before {
            log.lights();
            top.level.take();
            filing.revision = log.revision(scene.origin);
        }
    }
}

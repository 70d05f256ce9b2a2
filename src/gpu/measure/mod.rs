//! For those who measure: the stages of the top level one by one, a sort to hold them against, and the nodes that a
//! sample reads. No frame needs any of it. `examples/gpu_timings` makes its tables with it.

mod count;
mod key_sort;

pub(super) use count::CountKernel;
pub use key_sort::KeySort;

use super::GpuLights;
use super::recorder::Recorder;

/// No build has more stages: a set of twice as many queries has room for the timestamps of any.
pub const MAX_TOP_STAGES: u32 = 64;

/// One stage of a build of the top level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TopStage {
    /// What it does; stages of one build may share a name.
    pub name: &'static str,
    /// That it takes.
    pub dispatches: u32,
}

/// Bytes of the records that sampling reads, as they are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordBytes {
    /// Of either level.
    pub node: u32,
    /// Of a tree, or directional.
    pub light: u32,
    /// With its transforms.
    pub instance: u32,
}

impl GpuLights {
    /// As [`GpuLights::build_top`], but each stage in a compute pass of its own, whether or not anything was uploaded
    /// since the last build. Returns the stages in order; the i-th begins at timestamp 2 i and ends at 2 i + 1 of
    /// `queries`, if any are given: a set of timestamps with room for twice [`MAX_TOP_STAGES`].
    ///
    /// Passes of their own cost a little: see the sum against that of one pass before trusting it.
    pub fn build_top_timed(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        queries: Option<&wgpu::QuerySet>,
    ) -> Vec<TopStage> {
        self.top_status.record(encoder);
        let mut recorder = Recorder::apart(encoder, "girandole top level", queries);
        self.top.record(&mut recorder, self.params.slots);
        recorder.finish()
    }

    /// Bytes of each kind of record since the last upload.
    pub fn record_bytes(&self) -> RecordBytes {
        let strides = self.params.strides;
        RecordBytes { node: 16 * strides.node, light: 16 * strides.light, instance: 16 * strides.instance }
    }
}

#[cfg(test)]
mod tests;

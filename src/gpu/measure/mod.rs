//! Measurements on the GPU: the stages of the top-level build one by one, its sort alone, and the
//! number of nodes that a sample reads.
//!
//! This module is no part of the API: it serves the tests, benches and measuring tools of this
//! project, and may change with any version.

mod count;
mod key_sort;

pub use count::NodeCounter;
pub use key_sort::KeySort;

use super::GpuLights;
use super::recorder::Recorder;
pub use super::recorder::TopStage;
use crate::plan::top;

/// The largest number of stages of a top-level build. A query set of twice as many timestamps has
/// room for any build.
pub const MAX_TOP_STAGES: u32 = 64;

const _: () = assert!(top::MAX_STAGES <= MAX_TOP_STAGES);

/// The sizes in bytes of the records that sampling reads, as they are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct RecordBytes {
    /// A node of either level.
    pub node: u32,
    /// A light of a tree, or a directional light.
    pub light: u32,
    /// An instance with its transforms.
    pub instance: u32,
}

/// Records the build of the top level with each stage in a compute pass of its own. Unlike
/// [`GpuLights::build_top`] it records the build even if nothing was uploaded since the last one.
///
/// Returns the stages in order. If `queries` is given, the i-th stage begins at its timestamp 2 i
/// and ends at 2 i + 1. The set must have room for twice [`MAX_TOP_STAGES`] timestamps.
///
/// Separate passes have a cost of their own. Compare the sum of the stages with the time of
/// `build_top` before you rely on it.
pub fn build_top_timed(
    lights: &mut GpuLights,
    encoder: &mut wgpu::CommandEncoder,
    queries: Option<&wgpu::QuerySet>,
) -> Vec<TopStage> {
    lights.top_status.record(encoder);
    let mut recorder = Recorder::apart(encoder, "girandole top level", queries);
    lights.player.record(&mut recorder, &lights.top);
    recorder.finish()
}

/// The sizes of all records as of the last upload.
pub fn record_bytes(lights: &GpuLights) -> RecordBytes {
    let strides = lights.planner.strides();
    RecordBytes { node: 16 * strides.node, light: 16 * strides.light, instance: 16 * strides.instance }
}

#[cfg(test)]
mod tests;

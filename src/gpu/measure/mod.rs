//! Measurements on the GPU: the stages of the top-level build one by one, and the sizes of records.
//!
//! This module is no part of the API: it serves the tests, benches and measuring tools of this
//! project, and may change with any version.

use super::GpuLights;
use super::recorder::Recorder;
pub use super::recorder::TopStage;
use crate::plan::{layout, top};

/// The largest number of stages of a top-level build. A query set of twice as many timestamps has
/// room for any build.
pub const MAX_TOP_STAGES: u32 = 64;

const _: () = assert!(top::MAX_STAGES <= MAX_TOP_STAGES);

/// The bytes of a node of either level, of a light, and of an instance with its transforms.
pub const NODE_BYTES: u32 = 16 * layout::NODE_QUADS;
pub const LIGHT_BYTES: u32 = 16 * layout::RECORD_QUADS;
pub const INSTANCE_BYTES: u32 = 16 * layout::INSTANCE_QUADS;

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

#[cfg(test)]
mod tests;

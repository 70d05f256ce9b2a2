//! Measurements on the GPU: the stages of the top-level build one by one, and the sizes of records.
//!
//! This module is no part of the API: it serves the tests, benches and measuring tools of this
//! project, and may change with any version.

use super::GpuLights;
use super::bindings::label_of;
use crate::plan::{Command, layout, top};

/// One stage of a build of the top level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct TopStage {
    /// The name of what the stage does. Several stages of one build may share a name.
    pub name: &'static str,
    /// The number of its dispatches.
    pub dispatches: u32,
}

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
    let stage = |command: &Command<'_>| match command {
        Command::Dispatch { kernel, .. } => Some(kernel.stage()),
        _ => None,
    };
    let commands: Vec<Command<'_>> = lights.top.iter().collect();
    let mut stages = Vec::new();
    for some in commands.chunk_by(|a, b| stage(a) == stage(b)) {
        let first = 2 * stages.len() as u32;
        stages.extend(stage(&some[0]).map(|name| TopStage { name, dispatches: some.len() as u32 }));
        let label = label_of(stage(&some[0]).unwrap_or_default());
        let timestamp_writes = queries.map(|query_set| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        });
        let descriptor = wgpu::ComputePassDescriptor { label: Some(&label), timestamp_writes };
        lights.player.record(encoder, &descriptor, some.iter().copied());
    }
    stages
}

#[cfg(test)]
mod tests;

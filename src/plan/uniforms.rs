//! The small buffers of a planner: uniforms, and what records are staged in.

use super::buffers::BufferId;
use super::layout::ParamsRecord;

/// The uniforms of shaders and kernels, and the buffer of staged records.
pub(super) struct Uniforms {
    /// What the uniform of shaders holds.
    pub params: ParamsRecord,
    pub params_buffer: Option<BufferId>,
    /// The uniform of the pass that scatters staged records. Made at first use, like their buffer.
    pub scatter: Option<BufferId>,
    /// The buffer of staged records, and its bytes.
    pub staging: Option<(BufferId, u64)>,
}

/// New buffers of a frame in place of these.
#[derive(Debug, Default)]
pub(super) struct NewUniforms {
    pub params: Option<BufferId>,
    pub scatter: Option<BufferId>,
    pub staging: Option<(BufferId, u64)>,
}

impl Uniforms {
    /// No buffers yet.
    pub fn new() -> Self {
        Self { params: ParamsRecord::default(), params_buffer: None, scatter: None, staging: None }
    }
}

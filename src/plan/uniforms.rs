//! The small buffers of a planner: uniforms, and what records are staged in.

use super::buffers::BufferId;
use super::draft::Draft;
use super::layout::ParamsRecord;
use super::scatter;

/// The uniforms of shaders and kernels, and the buffer of staged records.
#[derive(Clone, Default)]
pub(super) struct Uniforms {
    /// What the uniform of shaders holds.
    pub params: ParamsRecord,
    pub params_buffer: Option<BufferId>,
    /// The uniform of the pass that scatters staged records. Made at first use, like their buffer.
    pub scatter: Option<BufferId>,
    /// The buffer of staged records, and its bytes.
    pub staging: Option<(BufferId, u64)>,
}

impl Uniforms {
    /// Room for `bytes` of staged records, in a buffer of at most `most`, and the uniform of the pass.
    pub fn stage(&mut self, bytes: u64, most: u64, draft: &mut Draft) -> [BufferId; 2] {
        let uniform = *self.scatter.get_or_insert_with(|| draft.uniform("scatter", scatter::UNIFORM_BYTES));
        match self.staging {
            Some((staging, present)) if present >= bytes => [staging, uniform],
            former => {
                let bytes = bytes.max(former.map_or(0, |(_, present)| 2 * present)).min(most & !3);
                let staging = draft.storage("staged records", bytes);
                self.staging = Some((staging, bytes));
                draft.plan.freed.extend(former.map(|(id, _)| id));
                [staging, uniform]
            }
        }
    }
}

//! Copies records from one stored layout to another on the GPU, so that a change of layout sends no
//! records from the CPU.

use super::buffers::BufferId;
use super::commands::Commands;
use super::kernel::{Binding, Kernel, UNIFORM_ALIGNMENT};
use super::stored::{Missing, Stored};

/// Invocations in a workgroup. Each writes 16 bytes.
const LANES: u32 = 64;

/// The longest record, in units of 16 bytes.
const MAX_QUADS: usize = 14;

/// The entry of [`RelayoutPass::sources`] for a word that was not stored.
const NOT_STORED: u32 = u32::MAX;

/// Twin of `RelayoutPass` in `shaders/relayout.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
struct RelayoutPass {
    /// The number of records.
    records: u32,
    /// The stride in the old layout, in words.
    words_before: u32,
    /// The stride in the new layout, in units of 16 bytes.
    quads_after: u32,
    padding: u32,
    /// For each word of the new record its offset in the old record, or [`NOT_STORED`].
    sources: [[u32; 4]; MAX_QUADS],
    /// For each word of the new record its value if it was not stored.
    values: [[u32; 4]; MAX_QUADS],
}

impl RelayoutPass {
    fn new(records: u32, before: &Stored, after: &Stored, missing: fn(usize) -> Missing) -> Self {
        let mut pass = Self {
            records,
            words_before: before.bytes() as u32 / 4,
            quads_after: after.bytes() as u32 / 16,
            padding: 0,
            sources: [[NOT_STORED; 4]; MAX_QUADS],
            values: [[0; 4]; MAX_QUADS],
        };
        for (place, word) in after.words().enumerate() {
            let source = before.word_offset(word).map_or_else(|| missing(word), Missing::Word);
            match source {
                Missing::Value(value) => pass.values[place / 4][place % 4] = value,
                Missing::Word(source) => pass.sources[place / 4][place % 4] = source as u32,
            }
        }
        pass
    }
}

/// Bytes from one pass of the uniform to the next.
pub(crate) const RELAYOUT_STRIDE: u32 = (size_of::<RelayoutPass>() as u32).next_multiple_of(UNIFORM_ALIGNMENT);

/// Reads one buffer of records and writes the other.
pub(crate) const RELAYOUT: Kernel = Kernel::new(
    "relayout",
    "relayout",
    &[Binding::Uniform { bytes: size_of::<RelayoutPass>() as u32 }, Binding::Read, Binding::ReadWrite],
    text,
);

/// Adds the commands that copy the first `records` records from one buffer to another. They use the
/// pass of the uniform with index `pass`. Sends a few hundred bytes.
pub(crate) fn relayout(
    commands: &mut Commands,
    records: u32,
    (from, before): (BufferId, &Stored),
    (to, after): (BufferId, &Stored),
    missing: fn(usize) -> Missing,
    (uniform, pass): (BufferId, u32),
) {
    let record = RelayoutPass::new(records, before, after, missing);
    let offset = pass * RELAYOUT_STRIDE;
    commands.write(uniform, u64::from(offset), bytemuck::bytes_of(&record));
    commands.dispatch(RELAYOUT, &[uniform, from, to], offset, (records * record.quads_after).div_ceil(LANES));
}

fn text() -> String {
    format!(
        "const RELAYOUT_LANES: u32 = {LANES}u;\nconst RELAYOUT_QUADS: u32 = {MAX_QUADS}u;\n\
         const RELAYOUT_NOT_STORED: u32 = {NOT_STORED}u;\n{}",
        include_str!("../../shaders/relayout.wgsl")
    )
}

#[cfg(test)]
mod tests {
    use naga::TypeInner;

    use super::*;
    use crate::plan::layout::{InstanceRecord, LightRecord};
    use crate::plan::node_record::NodeRecord;

    #[test]
    fn the_stage_is_valid_and_its_uniform_has_the_layout_of_the_rust_struct() {
        let text = text();
        let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect("it parses");
        let (_, pass) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some("RelayoutPass")).expect("a struct");
        let TypeInner::Struct { members, span } = &pass.inner else { panic!("RelayoutPass is a struct") };
        let theirs: Vec<_> = members.iter().map(|m| m.offset as usize).collect();
        let ours = [
            std::mem::offset_of!(RelayoutPass, records),
            std::mem::offset_of!(RelayoutPass, words_before),
            std::mem::offset_of!(RelayoutPass, quads_after),
            std::mem::offset_of!(RelayoutPass, padding),
            std::mem::offset_of!(RelayoutPass, sources),
            std::mem::offset_of!(RelayoutPass, values),
        ];
        assert_eq!((theirs, *span as usize), (ours.to_vec(), size_of::<RelayoutPass>()));
        assert_eq!(module.entry_points[0].workgroup_size, [LANES, 1, 1]);
        let longest = [size_of::<NodeRecord>(), size_of::<LightRecord>(), size_of::<InstanceRecord>()];
        assert_eq!(longest.into_iter().max(), Some(16 * MAX_QUADS));
    }
}

//! Sorts 32-bit keys, each with a 32-bit value, on the GPU.
//!
//! A stable least-significant-digit radix sort in four passes of 8 bits, each of which is one dispatch.
//! Based on Satish, Harris and Garland, Designing Efficient Sorting Algorithms for Manycore GPUs
//! (2009). Differs:
//!
//! - The rank of a key among the lanes of its workgroup comes from a bitmap in workgroup memory, one
//!   bit for each lane and digit, so neither subgroups nor a local sort are needed.
//! - A pass that writes a key to its place also counts the key's next digit in the block of that place.
//!   So no pass begins with a count. Sums over sixteen blocks are counted too, which each workgroup
//!   adds up by itself, so there is no scan either.
//!
//! One-sweep sorts need one dispatch for each pass too, but in them workgroups wait for other
//! workgroups, and WGSL does not guarantee that those make progress.
//!
//! Blocks are as short as it takes to have [`TARGET_BLOCKS`] of them, so that small inputs also
//! spread over the whole GPU. Blocks stop growing at [`MAX_ROUNDS`] keys a lane, where the
//! counts of all passes take about a quarter of the memory of the keys.

use super::buffers::BufferId;
use super::commands::Commands;
use super::draft::Draft;
use super::error::PlanError;
use super::kernel::{Binding, Kernel, MAX_WORKGROUPS, UNIFORM_ALIGNMENT, pass_bytes};
use super::text::wgsl_of_kernel;
use crate::effects::Effects;

/// Invocations in a workgroup, and values of a digit.
const LANES: u32 = 256;
const DIGIT_BITS: u32 = LANES.ilog2();
/// An even number, so that the sorted keys end in the buffer that held the unsorted keys.
const PASSES: u32 = u32::BITS / DIGIT_BITS;
/// The number of blocks that few keys are divided into. With more keys, blocks grow first.
const TARGET_BLOCKS: u32 = 256;
/// Blocks whose counts are added up. A workgroup reads at most this many counts of single blocks for
/// each digit, and one for each group of blocks.
const GROUP: u32 = 16;
/// Keys for each lane of a block; more only if a dispatch could not hold all blocks otherwise.
const MAX_ROUNDS: u32 = 16;
/// The largest number of keys. The last block may extend past the keys by up to 129 rounds of 256
/// lanes, and the shaders count these places in a `u32` too.
const MAX_KEYS: u32 = 1 << 31;

/// The constants that the files need.
pub(crate) const CONSTANTS: [(&str, u32); 4] =
    [("SORT_LANES", LANES), ("SORT_DIGIT_BITS", DIGIT_BITS), ("SORT_WORDS", LANES / u32::BITS), ("SORT_GROUP", GROUP)];

/// The types and functions that all stages share.
pub(crate) const TYPES: &str = shader!("sort_types");

/// The function that counts keys.
pub(crate) const HISTOGRAM: &str = shader!("sort_histogram");

fn text(_: Effects) -> String {
    let files = [TYPES, HISTOGRAM, shader!("sort_prefix"), shader!("sort_scatter")];
    wgsl_of_kernel(&CONSTANTS, &[], &files)
}

/// Twin of `SortPass` in `shaders/sort_types.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct SortPass {
    count: u32,
    block_keys: u32,
    shift: u32,
    counts: u32,
    next_counts: u32,
}

/// Keys and values in, keys and values out, histogram.
pub(crate) const BINDINGS: &[Binding] = &[
    Binding::Uniform { bytes: size_of::<SortPass>() as u32 },
    Binding::Read,
    Binding::Read,
    Binding::ReadWrite,
    Binding::ReadWrite,
    Binding::ReadWrite,
];

pub(super) const SCATTER_KEYS: Kernel = Kernel::new("sort_scatter", "sort", BINDINGS, text);

/// Keys, values and scratch memory of one sort.
#[derive(Clone, Debug)]
pub(crate) struct SortBuffers {
    /// The keys, as `u32`; in ascending order after the sort.
    pub keys: BufferId,
    /// The values, as `u32`; each has the same place as its key.
    pub values: BufferId,
    scratch_keys: BufferId,
    scratch_values: BufferId,
    /// The counts of all passes.
    pub histogram: BufferId,
    passes: BufferId,
    capacity: u32,
    count: u32,
}

/// The bytes of the keys and of the counts of so many keys. The counts of few keys are larger than the keys.
fn sizes(capacity: u32) -> [u64; 2] {
    [u64::from(capacity) * 4, u64::from(PASSES) * 4 * counts(max_blocks(capacity))]
}

impl SortBuffers {
    /// Room for `capacity` keys; 0 counts as 1. Takes about 17 bytes
    /// for each key from a million keys on, and 33 for each of 65,536 keys. The counts take at least
    /// 8 KiB.
    pub(crate) fn new(capacity: u32, draft: &mut Draft) -> Self {
        let capacity = capacity.max(1);
        let [keys_bytes, histogram_bytes] = sizes(capacity);
        Self {
            keys: draft.storage("sort keys", keys_bytes),
            values: draft.storage("sort values", keys_bytes),
            scratch_keys: draft.storage("sort scratch keys", keys_bytes),
            scratch_values: draft.storage("sort scratch values", keys_bytes),
            histogram: draft.storage("sort histogram", histogram_bytes),
            passes: draft.uniform("sort passes", u64::from(PASSES * UNIFORM_ALIGNMENT)),
            capacity,
            count: 0,
        }
    }

    /// Fails with [`PlanError::Full`] if a buffer for so many keys would be larger than `limit`, or if there are more
    /// than [`MAX_KEYS`].
    pub(crate) fn fit(capacity: u32, limit: u64) -> Result<(), PlanError> {
        let needed = sizes(capacity.max(1)).into_iter().fold(0, u64::max);
        let limit = limit.min(u64::from(MAX_KEYS) * 4);
        if needed > limit { Err(PlanError::Full { what: "sorted keys", needed, limit }) } else { Ok(()) }
    }

    /// All buffers.
    pub(crate) fn ids(&self) -> [BufferId; 6] {
        [self.keys, self.values, self.scratch_keys, self.scratch_values, self.histogram, self.passes]
    }

    /// Sets how many keys the next sorts sort, at most the capacity. Sends nothing if the count does
    /// not change.
    pub(crate) fn set_count(&mut self, commands: &mut Commands, count: u32) {
        assert!(count <= self.capacity, "{count} keys do not fit in buffers for {}", self.capacity);
        if count == self.count {
            return;
        }
        self.count = count;
        let (blocks, rounds) = blocks_and_rounds(count);
        // Within the histogram, which a `u32` counts: there are fewer counts than keys, or few keys.
        let counts_of = |pass: u32| pass * counts(blocks) as u32;
        let passes: [SortPass; PASSES as usize] = std::array::from_fn(|pass| SortPass {
            count,
            block_keys: rounds * LANES,
            shift: pass as u32 * DIGIT_BITS,
            counts: counts_of(pass as u32),
            next_counts: counts_of((pass as u32 + 1) % PASSES),
        });
        commands.write(self.passes, 0, &pass_bytes(&passes, UNIFORM_ALIGNMENT));
    }

    /// The device may lack the count, so the next call of [`SortBuffers::set_count`] sends it.
    pub(crate) fn lose(&mut self) {
        self.count = 0;
    }

    /// The number of keys of a block.
    pub(crate) fn block_keys(count: u32) -> u32 {
        blocks_and_rounds(count).1 * LANES
    }

    /// Clears the counts. Comes before the keys are counted.
    pub(crate) fn clear(&self, commands: &mut Commands) {
        let (blocks, _) = blocks_and_rounds(self.count);
        commands.zero(self.histogram, 0..u64::from(PASSES) * 4 * counts(blocks));
    }

    /// Adds the sort, in place, of the first keys and their values; [`SortBuffers::set_count`] sets how many. Comes after
    /// [`SortBuffers::clear`] and after another stage has counted the digits of the first pass, by the function of
    /// [`HISTOGRAM`]. Takes four dispatches for any count from 2 on, and none below.
    pub(crate) fn sort_counted(&self, commands: &mut Commands) {
        if self.count < 2 {
            return;
        }
        let (blocks, _) = blocks_and_rounds(self.count);
        let ours = [self.keys, self.values];
        let scratch = [self.scratch_keys, self.scratch_values];
        for pass in 0..PASSES {
            // The first pass reads the caller's buffers and writes the scratch buffers, the second
            // the reverse.
            let [[keys, values], [keys_out, values_out]] =
                if pass % 2 == 0 { [ours, scratch] } else { [scratch, ours] };
            let buffers = [self.passes, keys, values, keys_out, values_out, self.histogram];
            commands.dispatch(SCATTER_KEYS, &buffers, pass * UNIFORM_ALIGNMENT, blocks);
        }
    }
}

/// The number of counts of one pass over this many blocks.
fn counts(blocks: u32) -> u64 {
    u64::from(LANES) * (u64::from(blocks) + u64::from(blocks.div_ceil(GROUP)))
}

/// The number of blocks that `count` keys are divided into, and of the keys for each lane of a
/// block.
fn blocks_and_rounds(count: u32) -> (u32, u32) {
    let rounds = count.div_ceil(LANES * TARGET_BLOCKS).clamp(1, MAX_ROUNDS);
    let rounds = rounds.max(count.div_ceil(LANES * MAX_WORKGROUPS));
    (count.div_ceil(LANES * rounds), rounds)
}

/// The largest number of blocks of any count up to `capacity`. The number of blocks does not grow
/// steadily: it falls wherever the number of rounds rises.
fn max_blocks(capacity: u32) -> u32 {
    capacity.div_ceil(LANES).min(TARGET_BLOCKS.max(capacity.div_ceil(LANES * MAX_ROUNDS)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_get_more_rounds_where_there_are_many_keys() {
        let around = [65_536, 65_537, 1_050_000].map(blocks_and_rounds);
        assert_eq!(around, [(256, 1), (129, 2), (257, 16)]);
    }

    #[test]
    fn setting_the_same_count_again_sends_nothing() {
        let mut buffers = SortBuffers::new(10, &mut Draft::new(Default::default(), Default::default()));
        let mut commands = Commands::default();
        buffers.set_count(&mut commands, 10);
        assert_eq!(commands.len(), 1);
        buffers.set_count(&mut commands, 10);
        assert_eq!(commands.len(), 1);
        buffers.lose();
        buffers.set_count(&mut commands, 10);
        assert_eq!(commands.len(), 2, "what was lost is sent again");
    }

    #[test]
    fn more_keys_than_a_buffer_holds_are_refused() {
        let refused = |keys, limit| SortBuffers::fit(keys, limit).expect_err("too many");
        let limit = 128 << 20;
        let full = |needed, limit| PlanError::Full { what: "sorted keys", needed, limit };
        assert_eq!(refused((limit / 4) as u32 + 1, limit), full(limit + 4, limit));
        // 2^16 keys fit into 2^18 bytes, but the counts of four passes do not.
        assert_eq!(refused(1 << 16, 1 << 18), full(4 * (256 + 16) * 1024, 1 << 18));
    }

    #[test]
    fn blocks_cover_every_count_within_the_limits_of_a_dispatch() {
        let around = (0..=32).flat_map(|bit| [-1i64, 0, 1].map(|d| ((1i64 << bit) + d).clamp(1, 0xffff_ffff) as u32));
        let rounds_change = (1..=17).flat_map(|r| [-1, 0, 1].map(|d| (r * 65_536 + d) as u32));
        for count in around.chain(rounds_change) {
            let (blocks, rounds) = blocks_and_rounds(count);
            assert!(blocks <= MAX_WORKGROUPS, "{count} keys in {blocks} blocks");
            assert!(u64::from(blocks) * u64::from(rounds * LANES) >= u64::from(count));
            assert!(u64::from(blocks - 1) * u64::from(rounds * LANES) < u64::from(count), "{count}: an empty block");
            assert!(blocks <= max_blocks(count));
            assert!(max_blocks(count) <= max_blocks(count.saturating_add(1)));
            let places = u64::from(blocks) * u64::from(rounds * LANES);
            assert!(count > MAX_KEYS || places <= u64::from(u32::MAX), "the places of {count} keys fit in a u32");
        }
    }

    #[test]
    fn the_stages_have_the_sizes_that_the_host_expects() {
        let (entry, text) = (SCATTER_KEYS.entry(), SCATTER_KEYS.wgsl());
        let module = naga::front::wgsl::parse_str(&text).expect(entry);
        assert_eq!(module.entry_points.len(), 1);
        assert_eq!(module.entry_points[0].name, entry);
        assert_eq!(module.entry_points[0].workgroup_size, [LANES, 1, 1]);
        let (_, pass) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some("SortPass")).unwrap();
        let naga::TypeInner::Struct { members, span } = &pass.inner else { panic!("SortPass is a struct") };
        assert_eq!(*span as usize, size_of::<SortPass>());
        let offsets: Vec<_> = members.iter().map(|m| (m.name.as_deref().unwrap(), m.offset as usize)).collect();
        assert_eq!(
            offsets,
            [
                ("count", std::mem::offset_of!(SortPass, count)),
                ("block_keys", std::mem::offset_of!(SortPass, block_keys)),
                ("shift", std::mem::offset_of!(SortPass, shift)),
                ("counts", std::mem::offset_of!(SortPass, counts)),
                ("next_counts", std::mem::offset_of!(SortPass, next_counts)),
            ]
        );
        let workgroup_bytes: u32 = module
            .global_variables
            .iter()
            .filter(|(_, v)| v.space == naga::AddressSpace::WorkGroup)
            .map(|(_, v)| module.types[v.ty].inner.size(module.to_ctx()))
            .sum();
        assert!(workgroup_bytes <= wgpu::Limits::default().max_compute_workgroup_storage_size);
    }
}

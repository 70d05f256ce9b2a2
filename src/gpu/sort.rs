//! Sorts 32-bit keys, each with a 32-bit value, on the GPU.
//!
//! A stable least-significant-digit radix sort in four passes of 8 bits. Each pass counts the
//! digits of each block, adds up the counts, and scatters the keys. Based on Satish, Harris and
//! Garland, Designing Efficient Sorting Algorithms for Manycore GPUs (2009). Differs: the rank of a
//! key among the lanes of its workgroup comes from a bitmap in workgroup memory, one bit for each
//! lane and digit, so neither subgroups nor a local sort are needed. One-sweep sorts need fewer
//! passes over the keys, but in them workgroups wait for other workgroups, and WGSL does not
//! guarantee that those make progress.
//!
//! Blocks are as short as it takes to have [`TARGET_BLOCKS`] of them, so that small inputs also
//! spread over the whole GPU. Blocks stop growing at [`MAX_ROUNDS`] keys a lane, where the counts
//! take a sixteenth of the memory of the keys.

use super::error::{GpuError, largest_storage_buffer};
use super::memory;
use super::recorder::Recorder;
use super::stages::{Access, MAX_WORKGROUPS, PASS_STRIDE, Stages, pass_bytes};

/// Invocations in a workgroup, and values of a digit.
const LANES: u32 = 256;
const DIGIT_BITS: u32 = LANES.ilog2();
/// An even number, so that the sorted keys end in the buffer that held the unsorted keys.
const PASSES: u32 = u32::BITS / DIGIT_BITS;
/// The number of blocks from which on blocks grow. The scan adds up this many counts in one step.
const TARGET_BLOCKS: u32 = 256;
/// Keys for each lane of a block; more only if a dispatch could not hold all blocks otherwise.
const MAX_ROUNDS: u32 = 16;
/// The largest number of keys. The last block may extend past the keys by up to 257 rounds of 256
/// lanes, and the shaders count these places in a `u32` too.
const MAX_KEYS: u32 = 1 << 31;

/// The text of a stage: constants, the shared file, and the files of the stage.
fn text(parts: &[&str]) -> String {
    let constants = format!("const SORT_LANES: u32 = {LANES}u;\nconst SORT_WORDS: u32 = {}u;\n", LANES / u32::BITS);
    constants + include_str!("../../shaders/sort_types.wgsl") + &parts.concat()
}

fn count_text() -> String {
    text(&[include_str!("../../shaders/sort_count.wgsl")])
}

fn scan_text() -> String {
    text(&[include_str!("../../shaders/sort_prefix.wgsl"), include_str!("../../shaders/sort_scan.wgsl")])
}

fn scatter_text() -> String {
    text(&[include_str!("../../shaders/sort_prefix.wgsl"), include_str!("../../shaders/sort_scatter.wgsl")])
}

/// Twin of `SortPass` in `shaders/sort_types.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct SortPass {
    count: u32,
    blocks: u32,
    rounds: u32,
    shift: u32,
}

/// The pipelines of the sort. One set serves any number of buffers.
#[derive(Debug)]
pub(crate) struct RadixSort {
    stages: Stages,
    count: wgpu::ComputePipeline,
    scan: wgpu::ComputePipeline,
    scatter: wgpu::ComputePipeline,
}

impl RadixSort {
    pub(crate) fn new(device: &wgpu::Device) -> Self {
        // Keys and values in, keys and values out, histogram.
        let storage = [Access::Read, Access::Read, Access::Write, Access::Write, Access::Write];
        let stages = Stages::new(device, "sort", size_of::<SortPass>() as u64, &storage);
        Self {
            count: stages.pipeline(device, "sort_count", count_text()),
            scan: stages.pipeline(device, "sort_scan", scan_text()),
            scatter: stages.pipeline(device, "sort_scatter", scatter_text()),
            stages,
        }
    }

    /// Records the sort, in place, of the first keys and their values; [`SortBuffers::set_count`]
    /// sets how many. Takes 12 dispatches for any count from 2 on, and none below.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, buffers: &SortBuffers) {
        if buffers.count < 2 {
            return;
        }
        let (blocks, _) = blocks_and_rounds(buffers.count);
        for (pass, group) in (0..PASSES).zip(buffers.groups.iter().cycle()) {
            recorder.set_bind_group(0, group, &[pass * PASS_STRIDE]);
            recorder.set_pipeline(&self.count);
            recorder.dispatch(blocks);
            recorder.set_pipeline(&self.scan);
            recorder.dispatch(LANES);
            recorder.set_pipeline(&self.scatter);
            recorder.dispatch(blocks);
        }
    }
}

/// Keys, values and scratch memory of one sort.
#[derive(Debug)]
pub(crate) struct SortBuffers {
    keys: wgpu::Buffer,
    values: wgpu::Buffer,
    passes: wgpu::Buffer,
    /// The first reads the caller's buffers and writes the scratch buffers, the second the reverse.
    groups: [wgpu::BindGroup; 2],
    capacity: u32,
    count: u32,
}

impl SortBuffers {
    /// Makes room for `capacity` keys; 0 counts as 1. Takes about 16.3 bytes for each key, and 20
    /// where there are few keys.
    ///
    /// Fails with [`GpuError::Full`] if the device cannot bind that many keys as one buffer, or if
    /// there are more than [`MAX_KEYS`]. Also fails with [`GpuError::OutOfMemory`].
    pub(crate) fn new(device: &wgpu::Device, sort: &RadixSort, capacity: u32) -> Result<Self, GpuError> {
        let capacity = capacity.max(1);
        let keys_bytes = u64::from(capacity) * 4;
        // The counts of few keys are larger than the keys.
        let histogram_bytes = u64::from(LANES) * (u64::from(max_blocks(capacity)) + 1) * 4;
        let needed = keys_bytes.max(histogram_bytes);
        let limit = largest_storage_buffer(device).min(u64::from(MAX_KEYS) * 4);
        if needed > limit {
            return Err(GpuError::Full { what: "sorted keys", needed, limit });
        }
        let buffer = |what, bytes, usage| memory::create_buffer(device, what, bytes, usage);
        let caller = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let keys = buffer("sort keys", keys_bytes, caller)?;
        let values = buffer("sort values", keys_bytes, caller)?;
        let scratch_keys = buffer("sort scratch keys", keys_bytes, wgpu::BufferUsages::STORAGE)?;
        let scratch_values = buffer("sort scratch values", keys_bytes, wgpu::BufferUsages::STORAGE)?;
        let histogram = buffer("sort histogram", histogram_bytes, wgpu::BufferUsages::STORAGE)?;
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let passes = buffer("sort passes", u64::from(PASSES * PASS_STRIDE), uniform)?;
        let groups = [
            sort.stages.bind(device, &passes, &[&keys, &values, &scratch_keys, &scratch_values, &histogram]),
            sort.stages.bind(device, &passes, &[&scratch_keys, &scratch_values, &keys, &values, &histogram]),
        ];
        Ok(Self { keys, values, passes, groups, capacity, count: 0 })
    }

    /// Sets how many keys the next submission sorts, at most the capacity. Returns the bytes that
    /// it sends: 0 if the count does not change.
    pub(crate) fn set_count(&mut self, queue: &wgpu::Queue, count: u32) -> u64 {
        assert!(count <= self.capacity, "{count} keys do not fit in buffers for {}", self.capacity);
        if count == self.count {
            return 0;
        }
        self.count = count;
        let (blocks, rounds) = blocks_and_rounds(count);
        let passes: [SortPass; PASSES as usize] =
            std::array::from_fn(|pass| SortPass { count, blocks, rounds, shift: pass as u32 * DIGIT_BITS });
        let bytes = pass_bytes(&passes);
        queue.write_buffer(&self.passes, 0, &bytes);
        bytes.len() as u64
    }

    /// The keys, as `u32`; in ascending order after the sort.
    pub(crate) fn keys(&self) -> &wgpu::Buffer {
        &self.keys
    }

    /// The values, as `u32`; each has the same place as its key.
    pub(crate) fn values(&self) -> &wgpu::Buffer {
        &self.values
    }
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
    use crate::dice::hash;
    use crate::gpu::testing::{gpu, limited_gpu, read};

    /// The same keys every time, with only the bits of `mask`.
    fn random_keys(count: u32, mask: u32) -> Vec<u32> {
        (0..count).map(|i| hash(i) & mask).collect()
    }

    /// Sorts keys whose values are their places, so one comparison checks order, pairing and
    /// stability.
    fn check(sort: &RadixSort, buffers: &mut SortBuffers, keys: &[u32]) {
        let (device, queue) = gpu();
        let count = keys.len() as u32;
        let values: Vec<u32> = (0..count).collect();
        queue.write_buffer(buffers.keys(), 0, bytemuck::cast_slice(keys));
        queue.write_buffer(buffers.values(), 0, bytemuck::cast_slice(&values));
        buffers.set_count(&queue, count);
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut recorder = Recorder::together(&mut encoder, "test sort");
        recorder.stage("sort");
        sort.record(&mut recorder, buffers);
        drop(recorder);
        queue.submit([encoder.finish()]);
        let mut expected: Vec<(u32, u32)> = keys.iter().copied().zip(values).collect();
        expected.sort_by_key(|pair| pair.0);
        let found_keys = read::<u32>(&device, &queue, buffers.keys());
        let found_values = read::<u32>(&device, &queue, buffers.values());
        let found = found_keys.into_iter().zip(found_values).take(keys.len());
        assert!(found.eq(expected), "{count} keys are not sorted as a stable sort does it");
    }

    #[test]
    fn counts_around_the_sizes_of_a_word_and_a_block_sort_stably() {
        let (device, _) = gpu();
        let sort = RadixSort::new(&device);
        let mut buffers = SortBuffers::new(&device, &sort, 4097).unwrap();
        for count in [0, 1, 2, 31, 32, 33, 255, 256, 257, 511, 512, 513, 4095, 4096, 4097] {
            check(&sort, &mut buffers, &random_keys(count, u32::MAX));
            // Few different keys: only their values tell equal keys apart.
            check(&sort, &mut buffers, &random_keys(count, 0x0100_0301));
        }
    }

    #[test]
    fn equal_sorted_and_reversed_keys_sort_stably() {
        let (device, _) = gpu();
        let sort = RadixSort::new(&device);
        let mut buffers = SortBuffers::new(&device, &sort, 5000).unwrap();
        check(&sort, &mut buffers, &[0; 5000]);
        check(&sort, &mut buffers, &[u32::MAX; 5000]);
        let mut keys = random_keys(5000, u32::MAX);
        keys.sort_unstable();
        check(&sort, &mut buffers, &keys);
        keys.reverse();
        check(&sort, &mut buffers, &keys);
    }

    #[test]
    fn blocks_of_several_rounds_sort_stably() {
        let (device, _) = gpu();
        let sort = RadixSort::new(&device);
        let mut buffers = SortBuffers::new(&device, &sort, 100_000).unwrap();
        assert_eq!(blocks_and_rounds(65_536), (256, 1));
        check(&sort, &mut buffers, &random_keys(65_536, u32::MAX));
        assert_eq!(blocks_and_rounds(65_537), (129, 2));
        check(&sort, &mut buffers, &random_keys(65_537, u32::MAX));
        check(&sort, &mut buffers, &random_keys(100_000, u32::MAX));
        check(&sort, &mut buffers, &random_keys(100_000, 0xff));
    }

    #[test]
    fn more_blocks_than_one_scan_step_adds_up_sort_stably() {
        let (device, _) = gpu();
        let sort = RadixSort::new(&device);
        let count = 1_050_000;
        assert_eq!(blocks_and_rounds(count), (257, 16));
        let mut buffers = SortBuffers::new(&device, &sort, count).unwrap();
        check(&sort, &mut buffers, &random_keys(count, u32::MAX));
    }

    #[test]
    fn setting_the_same_count_again_sends_nothing() {
        let (device, queue) = gpu();
        let sort = RadixSort::new(&device);
        let mut buffers = SortBuffers::new(&device, &sort, 10).unwrap();
        assert!(buffers.set_count(&queue, 10) > 0);
        assert_eq!(buffers.set_count(&queue, 10), 0);
    }

    #[test]
    fn more_keys_than_the_device_can_bind_are_refused() {
        let (device, _) = gpu();
        let sort = RadixSort::new(&device);
        let limit = largest_storage_buffer(&device);
        let error = SortBuffers::new(&device, &sort, (limit / 4) as u32 + 1).err();
        assert_eq!(error, Some(GpuError::Full { what: "sorted keys", needed: limit + 4, limit }));
        // 2^16 keys fit into 2^18 bytes, but their counts do not.
        let (device, _) = limited_gpu(
            &wgpu::Limits { max_storage_buffer_binding_size: 1 << 18, ..wgpu::Limits::default() },
            wgpu::Features::empty(),
        );
        let sort = RadixSort::new(&device);
        let error = SortBuffers::new(&device, &sort, 1 << 16).err();
        let needed = 257 * 1024;
        assert_eq!(error, Some(GpuError::Full { what: "sorted keys", needed, limit: 1 << 18 }));
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
        for (entry, text) in
            [("sort_count", count_text()), ("sort_scan", scan_text()), ("sort_scatter", scatter_text())]
        {
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
                    ("blocks", std::mem::offset_of!(SortPass, blocks)),
                    ("rounds", std::mem::offset_of!(SortPass, rounds)),
                    ("shift", std::mem::offset_of!(SortPass, shift)),
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
}

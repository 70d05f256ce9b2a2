//! Sorts 32-bit keys, each with a 32-bit value, on the GPU.
//!
//! Stable least-significant-digit radix sort, four passes of 8 bits. Each pass counts digits a block, adds the counts
//! up, and scatters: Satish, Harris and Garland, Designing Efficient Sorting Algorithms for Manycore GPUs (2009).
//! Differs: the rank of a key among the lanes of its workgroup comes from one bit a lane and digit in workgroup memory,
//! so neither subgroups nor a local sort are needed. One-sweep sorts need fewer passes over the keys, but they wait for
//! other workgroups, and WGSL does not promise that those ever run.
//!
//! Blocks are as short as it takes to have [`TARGET_BLOCKS`] of them, so small inputs still spread over the whole GPU;
//! they stop growing at [`MAX_ROUNDS`], where the counts are a sixteenth of the keys.

use super::error::{GpuError, largest_storage_buffer};
use super::memory;
use super::recorder::Recorder;
use super::stages::{Access, MAX_WORKGROUPS, PASS_STRIDE, Stages, pass_bytes};

/// Invocations in a workgroup, and values of a digit.
const LANES: u32 = 256;
const DIGIT_BITS: u32 = LANES.ilog2();
/// Even, so that the sorted keys end in the buffer that they came in.
const PASSES: u32 = u32::BITS / DIGIT_BITS;
/// Blocks to spread over before a block gets more than one round of keys. One scan step adds up as many.
const TARGET_BLOCKS: u32 = 256;
/// Keys a lane of a block, unless there are more blocks than one dispatch may have.
const MAX_ROUNDS: u32 = 16;

/// The text of a stage: Rust's constants, what the stages share, and the stage's own file.
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
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct SortPass {
    count: u32,
    blocks: u32,
    rounds: u32,
    shift: u32,
}

/// The pipelines; one set serves any number of buffers.
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

    /// Records the sort of the first keys, as many as [`SortBuffers::set_count`] was told, and their values, in place. Twelve dispatches,
    /// whatever the count; none for fewer than two keys.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, buffers: &SortBuffers) {
        if buffers.count < 2 {
            return;
        }
        let (blocks, _) = split(buffers.count);
        for (turn, group) in (0..PASSES).zip(buffers.groups.iter().cycle()) {
            recorder.set_bind_group(0, group, &[turn * PASS_STRIDE]);
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
pub(crate) struct SortBuffers {
    keys: wgpu::Buffer,
    values: wgpu::Buffer,
    passes: wgpu::Buffer,
    /// From the caller's buffers to the scratch ones, and back.
    groups: [wgpu::BindGroup; 2],
    capacity: u32,
    count: u32,
}

impl SortBuffers {
    /// Room for `capacity` keys (at least one). Holds about 16.3 bytes a key, and 20 where there are few.
    ///
    /// Fails with [`GpuError::Full`] where the device cannot bind as many keys at once, and with
    /// [`GpuError::OutOfMemory`].
    pub(crate) fn new(device: &wgpu::Device, sort: &RadixSort, capacity: u32) -> Result<Self, GpuError> {
        let capacity = capacity.max(1);
        let keys_bytes = u64::from(capacity) * 4;
        // Of few keys the counts take more.
        let histogram_bytes = u64::from(LANES) * (u64::from(most_blocks(capacity)) + 1) * 4;
        let needed = keys_bytes.max(histogram_bytes);
        let limit = largest_storage_buffer(device);
        if needed > limit {
            return Err(GpuError::Full { what: "sorted keys", needed, limit });
        }
        let buffer = |what, bytes, usage| memory::create_buffer(device, what, bytes, usage);
        let shared = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let keys = buffer("sort keys", keys_bytes, shared)?;
        let values = buffer("sort values", keys_bytes, shared)?;
        let other_keys = buffer("sort scratch keys", keys_bytes, wgpu::BufferUsages::STORAGE)?;
        let other_values = buffer("sort scratch values", keys_bytes, wgpu::BufferUsages::STORAGE)?;
        let histogram = buffer("sort histogram", histogram_bytes, wgpu::BufferUsages::STORAGE)?;
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let passes = buffer("sort passes", u64::from(PASSES * PASS_STRIDE), uniform)?;
        let groups = [
            sort.stages.bind(device, &passes, &[&keys, &values, &other_keys, &other_values, &histogram]),
            sort.stages.bind(device, &passes, &[&other_keys, &other_values, &keys, &values, &histogram]),
        ];
        Ok(Self { keys, values, passes, groups, capacity, count: 0 })
    }

    /// Keys to sort from the next submission on; at most the capacity. Returns the bytes sent, none where
    /// the count is as before.
    pub(crate) fn set_count(&mut self, queue: &wgpu::Queue, count: u32) -> u64 {
        assert!(count <= self.capacity, "{count} keys in buffers for {}", self.capacity);
        if count == self.count {
            return 0;
        }
        self.count = count;
        let (blocks, rounds) = split(count);
        let passes: [SortPass; PASSES as usize] =
            std::array::from_fn(|turn| SortPass { count, blocks, rounds, shift: turn as u32 * DIGIT_BITS });
        let bytes = pass_bytes(&passes);
        queue.write_buffer(&self.passes, 0, &bytes);
        bytes.len() as u64
    }

    /// The keys, as u32: unsorted before the sort, ascending after it.
    pub(crate) fn keys(&self) -> &wgpu::Buffer {
        &self.keys
    }

    /// The values, as u32, each in its key's place.
    pub(crate) fn values(&self) -> &wgpu::Buffer {
        &self.values
    }
}

/// Blocks that `count` keys are split in, and keys a lane in each.
fn split(count: u32) -> (u32, u32) {
    let rounds = count.div_ceil(LANES * TARGET_BLOCKS).clamp(1, MAX_ROUNDS);
    let rounds = rounds.max(count.div_ceil(LANES * MAX_WORKGROUPS));
    (count.div_ceil(LANES * rounds), rounds)
}

/// No count up to `capacity` is split in more blocks. The number of blocks falls where that of rounds rises.
fn most_blocks(capacity: u32) -> u32 {
    capacity.div_ceil(LANES).min(TARGET_BLOCKS.max(capacity.div_ceil(LANES * MAX_ROUNDS)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::testing::{gpu, limited_gpu, read};

    /// Keys in a fixed arbitrary order (splitmix64's output function).
    fn random_keys(count: u32, mask: u32) -> Vec<u32> {
        let mix = |i: u32| {
            let x = u64::from(i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            (x >> 32) as u32 & mask
        };
        (0..count).map(mix).collect()
    }

    /// The values are the keys' first places, so one comparison checks order, pairing and stability.
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
    fn any_count_around_a_lane_a_word_and_a_block_sorts_stably() {
        let (device, _) = gpu();
        let sort = RadixSort::new(&device);
        let mut buffers = SortBuffers::new(&device, &sort, 4097).unwrap();
        for count in [0, 1, 2, 31, 32, 33, 255, 256, 257, 511, 512, 513, 4095, 4096, 4097] {
            check(&sort, &mut buffers, &random_keys(count, u32::MAX));
            // Few different keys: long runs of equals, told apart by their values alone.
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
        assert_eq!(split(65_536), (256, 1));
        check(&sort, &mut buffers, &random_keys(65_536, u32::MAX));
        assert_eq!(split(65_537), (129, 2));
        check(&sort, &mut buffers, &random_keys(65_537, u32::MAX));
        check(&sort, &mut buffers, &random_keys(100_000, u32::MAX));
        check(&sort, &mut buffers, &random_keys(100_000, 0xff));
    }

    #[test]
    fn more_blocks_than_one_scan_step_sort_stably() {
        let (device, _) = gpu();
        let sort = RadixSort::new(&device);
        let count = 1_050_000;
        assert_eq!(split(count), (257, 16));
        let mut buffers = SortBuffers::new(&device, &sort, count).unwrap();
        check(&sort, &mut buffers, &random_keys(count, u32::MAX));
    }

    #[test]
    fn a_count_that_does_not_change_sends_nothing() {
        let (device, queue) = gpu();
        let sort = RadixSort::new(&device);
        let mut buffers = SortBuffers::new(&device, &sort, 10).unwrap();
        assert!(buffers.set_count(&queue, 10) > 0);
        assert_eq!(buffers.set_count(&queue, 10), 0);
    }

    #[test]
    fn more_keys_than_the_device_binds_are_refused() {
        let (device, _) = gpu();
        let sort = RadixSort::new(&device);
        let limit = largest_storage_buffer(&device);
        let error = SortBuffers::new(&device, &sort, (limit / 4) as u32 + 1).err();
        assert_eq!(error, Some(GpuError::Full { what: "sorted keys", needed: limit + 4, limit }));
        // 2^16 keys fit in 2^18 bytes, but not their counts.
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
    fn every_split_covers_its_keys_within_the_limits() {
        let around = (0..=32).flat_map(|bit| [-1i64, 0, 1].map(|d| ((1i64 << bit) + d).clamp(1, 0xffff_ffff) as u32));
        let rounds_change = (1..=17).flat_map(|r| [-1, 0, 1].map(|d| (r * 65_536 + d) as u32));
        for count in around.chain(rounds_change) {
            let (blocks, rounds) = split(count);
            assert!(blocks <= MAX_WORKGROUPS, "{count} keys in {blocks} blocks");
            assert!(u64::from(blocks) * u64::from(rounds * LANES) >= u64::from(count));
            assert!(u64::from(blocks - 1) * u64::from(rounds * LANES) < u64::from(count), "{count}: an empty block");
            assert!(blocks <= most_blocks(count));
            assert!(most_blocks(count) <= most_blocks(count.saturating_add(1)));
        }
    }

    #[test]
    fn the_shaders_agree_with_the_host_about_sizes() {
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

//! The sort of keys.

use super::Rig;
use crate::effects::Effects;
use crate::gpu::testing::gpu;
use crate::math::dice::hash;
use crate::plan::Kernel;
use crate::plan::draft::Growth;
use crate::plan::sort::{BINDINGS, CONSTANTS, HISTOGRAM, SortBuffers, TYPES};
use crate::plan::text::wgsl_of_kernel;

/// Counts the digits of the first pass, as the stage that makes the keys does in plans.
const COUNT: Kernel = Kernel::new("sort_count", "sort", BINDINGS, count_text);

fn count_text(_: Effects) -> String {
    let own = "
        @group(0) @binding(0) var<uniform> pass_: SortPass;
        @group(0) @binding(1) var<storage, read> keys_in: array<u32>;
        @group(0) @binding(5) var<storage, read_write> histogram: array<atomic<u32>>;
        @compute @workgroup_size(SORT_LANES)
        fn sort_count(
            @builtin(workgroup_id) group: vec3<u32>,
            @builtin(num_workgroups) groups: vec3<u32>,
            @builtin(local_invocation_index) lane: u32,
        ) {
            let i = (group.x + group.y * groups.x) * SORT_LANES + lane;
            if i < pass_.count {
                sort_count_key(pass_.counts, pass_.count, pass_.block_keys, i, sort_digit(keys_in[i], pass_.shift));
            }
        }";
    wgsl_of_kernel(&CONSTANTS, &[], &[TYPES, HISTOGRAM, own])
}

/// The same keys every time, with only the bits of `mask`.
fn random_keys(count: u32, mask: u32) -> Vec<u32> {
    (0..count).map(|i| hash(i) & mask).collect()
}

fn buffers(rig: &mut Rig, capacity: u32) -> SortBuffers {
    rig.draft(Growth::Exact, |draft| SortBuffers::new(capacity, draft))
}

/// Sorts keys whose values are their places, so one comparison checks order, pairing and
/// stability.
fn check(rig: &mut Rig, buffers: &mut SortBuffers, keys: &[u32]) {
    let (_, queue) = gpu();
    let count = keys.len() as u32;
    let values: Vec<u32> = (0..count).collect();
    queue.write_buffer(rig.player.buffer(buffers.keys), 0, bytemuck::cast_slice(keys));
    queue.write_buffer(rig.player.buffer(buffers.values), 0, bytemuck::cast_slice(&values));
    rig.play(&[], |commands| {
        buffers.set_count(commands, count);
        buffers.clear(commands);
        let [keys, values, more_keys, more_values, histogram, passes] = buffers.ids();
        let bound = [passes, keys, values, more_keys, more_values, histogram];
        commands.dispatch(COUNT, &bound, 0, count.div_ceil(256));
        buffers.sort_counted(commands);
    });
    let mut expected: Vec<(u32, u32)> = keys.iter().copied().zip(values).collect();
    expected.sort_by_key(|pair| pair.0);
    let found = rig.read::<u32>(buffers.keys).into_iter().zip(rig.read::<u32>(buffers.values)).take(keys.len());
    assert!(found.eq(expected), "{count} keys are not sorted as a stable sort does it");
}

#[test]
fn counts_around_the_sizes_of_a_word_and_a_block_sort_stably() {
    let mut rig = Rig::new();
    let mut buffers = buffers(&mut rig, 4097);
    for count in [0, 1, 2, 31, 32, 33, 255, 256, 257, 511, 512, 513, 4095, 4096, 4097] {
        check(&mut rig, &mut buffers, &random_keys(count, u32::MAX));
        // Few different keys: only their values tell equal keys apart.
        check(&mut rig, &mut buffers, &random_keys(count, 0x0100_0301));
    }
}

#[test]
fn equal_sorted_and_reversed_keys_sort_stably() {
    let mut rig = Rig::new();
    let mut buffers = buffers(&mut rig, 5000);
    check(&mut rig, &mut buffers, &[0; 5000]);
    check(&mut rig, &mut buffers, &[u32::MAX; 5000]);
    let mut keys = random_keys(5000, u32::MAX);
    keys.sort_unstable();
    check(&mut rig, &mut buffers, &keys);
    keys.reverse();
    check(&mut rig, &mut buffers, &keys);
}

#[test]
fn blocks_of_several_rounds_sort_stably() {
    let mut rig = Rig::new();
    let mut buffers = buffers(&mut rig, 100_000);
    check(&mut rig, &mut buffers, &random_keys(65_536, u32::MAX));
    check(&mut rig, &mut buffers, &random_keys(65_537, u32::MAX));
    check(&mut rig, &mut buffers, &random_keys(100_000, u32::MAX));
    check(&mut rig, &mut buffers, &random_keys(100_000, 0xff));
}

#[test]
fn many_groups_of_blocks_sort_stably() {
    let mut rig = Rig::new();
    let count = 1_050_000;
    let mut buffers = buffers(&mut rig, count);
    check(&mut rig, &mut buffers, &random_keys(count, u32::MAX));
}

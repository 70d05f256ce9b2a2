// Makes shared cuts void until the next build if something was learnt since they were built. One invocation.

struct LightCutTable { grid: LightCutGrid, words: array<u32> }

// As in visibility_fold.wgsl.
@group(0) @binding(1) var<storage, read_write> learnt: array<u32>;
// As in cut_list.wgsl.
@group(0) @binding(2) var<storage, read_write> light_cuts: LightCutTable;

const HAS_LEARNT: u32 = 3u;
const TAUGHT: u32 = 19u;

@compute @workgroup_size(1)
fn visibility_void() {
    if learnt[HAS_LEARNT] != 0u {
        learnt[HAS_LEARNT] = 0u;
        light_cuts.words[0] = 0u;
        light_cuts.words[TAUGHT] = 1u;
    }
}

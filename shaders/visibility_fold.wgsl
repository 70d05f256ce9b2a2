// Folds the records of a frame into what is known about visibility: adds those of cells to those of their
// blocks, then folds the blocks, then the cells. Twin of src/visibility/fold.rs and of
// `VisibilityTable::end_frame`, with the same bits: all of it is integers. One workgroup for each row, one
// invocation for each word of shares.

// cut_grid.wgsl has what comes first; visibility.wgsl has what is learnt, and the records.
struct Cells { grid: LightCutGrid, words: array<u32> }

@group(0) @binding(1) var<storage, read_write> cells: Cells;
@group(0) @binding(2) var<storage, read_write> marks: array<atomic<u32>>;
// For each row and group, in the lower half of a word the visible records and in the upper half
// all.
@group(0) @binding(3) var<storage, read_write> known: array<u32>;

// Stands in place of the row of a block if a cell has none, as LIGHT_NO_ROW in visibility.wgsl does.
const NO_BLOCK: u32 = 0xffffffffu;
// The claim of the row, and whether it has counts.
var<workgroup> fate: vec2<u32>;
// The visible records and all, over the groups of the row.
var<workgroup> sums: array<atomic<u32>, 2>;

// The places of a word of what is learnt and of one of the records.
fn learnt(word: u32) -> u32 {
    return 4u * cells.grid.learnt + word;
}

fn recorded(word: u32) -> u32 {
    return cells.grid.records + word;
}

fn rows_of_cells() -> u32 {
    return cells.words[learnt(2u)];
}

fn rows_of_all() -> u32 {
    return rows_of_cells() + cells.words[learnt(7u)];
}

// The word of the hidden samples of a group. That of the visible ones comes next.
fn counts_at(row: u32, bin: u32) -> u32 {
    return 2u * (rows_of_all() + row * LIGHT_BINS + bin);
}

// The word of the first of four shares.
fn shares_at(row: u32, word: u32) -> u32 {
    return 4u * LIGHT_TABLE_HEAD + 2u * rows_of_all() + row * (LIGHT_BINS / 4u) + word;
}

// What is known after a frame. Twin of `fold`.
fn fold(before: u32, hidden_samples: u32, visible_samples: u32) -> u32 {
    var hidden = hidden_samples;
    var visible = visible_samples;
    while visible > LIGHT_MAX_NEW || hidden > LIGHT_MAX_NEW || visible + hidden > LIGHT_MAX_NEW {
        visible /= 2u;
        hidden /= 2u;
    }
    var seen = before & 0xffffu;
    var all = before >> 16u;
    if visible > 0u && LIGHT_RARE * seen <= all {
        seen /= LIGHT_DOUBT;
        all /= LIGHT_DOUBT;
    }
    seen += visible * LIGHT_UNITS;
    all += (visible + hidden) * LIGHT_UNITS;
    if all > LIGHT_MEMORY {
        seen = (seen * LIGHT_MEMORY + all / 2u) / all;
        all = LIGHT_MEMORY;
    }
    return seen | (all << 16u);
}

// Twin of `code`.
fn code_of(visible: u32, records: u32, prior: u32, prior_code: u32) -> u32 {
    let all = records + prior;
    return (LIGHT_FULL_SHARE * visible + prior_code * prior + all / 2u) / all;
}

// Adds the counts of a cell to those of its block.
@compute @workgroup_size(128)
fn visibility_gather(
    @builtin(local_invocation_index) lane: u32, @builtin(workgroup_id) group: vec3<u32>,
) {
    let row = group.x;
    let touched = atomicLoad(&marks[recorded(rows_of_all() + row)]);
    if touched == 0u || touched == NO_BLOCK {
        return;
    }
    let block = touched - 1u;
    if lane == 0u {
        atomicStore(&marks[recorded(rows_of_all() + block)], touched);
    }
    for (var i = 0u; i < 4u; i++) {
        let from_cell = counts_at(row, 4u * lane + i);
        let to_block = counts_at(block, 4u * lane + i);
        for (var k = 0u; k < 2u; k++) {
            let count = atomicLoad(&marks[recorded(from_cell + k)]);
            if count != 0u {
                atomicAdd(&marks[recorded(to_block + k)], count);
            }
        }
    }
}

// Folds a row.
fn fold_row(row: u32, lane: u32) {
    if lane == 0u {
        fate = vec2(atomicLoad(&marks[recorded(row)]), atomicLoad(&marks[recorded(rows_of_all() + row)]));
        // Players need not zero this memory.
        atomicStore(&sums[0], 0u);
        atomicStore(&sums[1], 0u);
    }
    let claim_and_touched = workgroupUniformLoad(&fate);
    let claim = claim_and_touched.x;
    let touched = claim_and_touched.y;
    let share_word = shares_at(row, lane);
    if touched != 0u {
        for (var i = 0u; i < 4u; i++) {
            let bin = row * LIGHT_BINS + 4u * lane + i;
            let counts = counts_at(row, 4u * lane + i);
            let hidden = atomicLoad(&marks[recorded(counts)]);
            let visible = atomicLoad(&marks[recorded(counts + 1u)]);
            if (hidden | visible) != 0u {
                known[bin] = fold(known[bin], hidden, visible);
                atomicStore(&marks[recorded(counts)], 0u);
                atomicStore(&marks[recorded(counts + 1u)], 0u);
            }
            atomicAdd(&sums[0], known[bin] & 0xffffu);
            atomicAdd(&sums[1], known[bin] >> 16u);
        }
        workgroupBarrier();
        var larger = 0x01010101u * code_of(atomicLoad(&sums[0]), atomicLoad(&sums[1]), LIGHT_FIRST, LIGHT_FULL_SHARE);
        if row < rows_of_cells() && touched != NO_BLOCK {
            larger = cells.words[learnt(shares_at(touched - 1u, lane))];
        }
        var shares = 0u;
        for (var i = 0u; i < 4u; i++) {
            let seen = known[row * LIGHT_BINS + 4u * lane + i];
            let code = code_of(seen & 0xffffu, seen >> 16u, LIGHT_PRIOR, (larger >> (8u * i)) & 0xffu);
            shares |= max(code, LIGHT_MIN_SHARE) << (8u * i);
        }
        cells.words[learnt(share_word)] = shares;
    } else if claim != 0u {
        for (var i = 0u; i < 4u; i++) {
            known[row * LIGHT_BINS + 4u * lane + i] = 0u;
        }
        cells.words[learnt(share_word)] = 0xffffffffu;
    }
    if lane == 0u {
        let tag = 4u * LIGHT_TABLE_HEAD + row;
        let idle = tag + rows_of_all();
        if touched != 0u {
            cells.words[learnt(tag)] |= LIGHT_LEARNT_BIT;
            cells.words[learnt(idle)] = 0u;
            // Cuts that know less are void.
            cells.words[0] = 0u;
            cells.words[1] = 1u;
        } else if claim != 0u {
            cells.words[learnt(tag)] = claim & ~LIGHT_LEARNT_BIT;
            cells.words[learnt(idle)] = 0u;
        } else {
            cells.words[learnt(idle)] = max(cells.words[learnt(idle)], cells.words[learnt(idle)] + 1u);
        }
        atomicStore(&marks[recorded(row)], 0u);
        atomicStore(&marks[recorded(rows_of_all() + row)], 0u);
    }
}

@compute @workgroup_size(128)
fn visibility_fold_blocks(
    @builtin(local_invocation_index) lane: u32, @builtin(workgroup_id) group: vec3<u32>,
) {
    fold_row(rows_of_cells() + group.x, lane);
}

@compute @workgroup_size(128)
fn visibility_fold_cells(
    @builtin(local_invocation_index) lane: u32, @builtin(workgroup_id) group: vec3<u32>,
) {
    fold_row(group.x, lane);
}

// Lists the cells to build, and gives rows to them and back. One invocation for each slot of the table.
// Twin of `CutTable::builds`.
//
// The head of the table: whether cuts are valid; the number of listed cells; the first and the end of
// the free rows in their ring, and where those end that were free before this frame; the number of cells
// to build; and counters.

@group(LIGHT_GROUP) @binding(6) var<storage, read_write> table: array<atomic<u32>>;
// What the build is dispatched with, and counters of the last build in words 4 to 9.
@group(LIGHT_GROUP) @binding(7) var<storage, read_write> report: array<u32>;

const LISTED: u32 = 1u;
const FIRST_FREE: u32 = 2u;
const END_OF_FREE: u32 = 3u;
const USABLE: u32 = 4u;
const TO_BUILD: u32 = 5u;
const MARKED: u32 = 8u;
const BUILT: u32 = 9u;
const KEPT: u32 = 10u;
const RARE: u32 = 11u;
const REFUSED: u32 = 12u;

fn last_row() -> u32 {
    return light_cut_grid.listed - light_cut_grid.free_rows - 1u;
}

// Takes the cut of a slot away.
fn give_back(at: u32) {
    atomicStore(&table[at + 3u], 0u);
    let row = atomicExchange(&table[at + 2u], 0u);
    if row != 0u {
        let end = atomicAdd(&table[END_OF_FREE], 1u);
        atomicStore(&table[light_cut_grid.free_rows + (end & last_row())], row);
    }
}

// Returns the number of points, and forgets them.
fn forget_points(at: u32) {
    for (var i = 0u; i < LIGHT_CELL_POINTS; i++) {
        atomicStore(&table[at + 9u + i], 0u);
    }
}

fn points(at: u32) -> u32 {
    var count = 0u;
    for (var i = 0u; i < LIGHT_CELL_POINTS; i++) {
        count += select(0u, 1u, atomicLoad(&table[at + 9u + i]) != 0u);
    }
    return count;
}

@compute @workgroup_size(64)
fn cut_list(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let slot = id.x + id.y * groups.x * 64u;
    if slot > light_cut_grid.last_slot {
        return;
    }
    let at = LIGHT_CUT_HEAD + LIGHT_SLOT_WORDS * slot;
    if atomicLoad(&table[at]) == 0u {
        return;
    }
    let count = atomicExchange(&table[at + 1u], 0u);
    if count == 0u {
        give_back(at);
        atomicStore(&table[at], 0u);
        return;
    }
    atomicAdd(&table[MARKED], 1u);
    if count < light_cut_grid.min_marks {
        atomicAdd(&table[RARE], 1u);
        give_back(at);
        forget_points(at);
        return;
    }
    let is_glossy = (atomicLoad(&table[at + 7u]) >> LIGHT_GLOSS_SHIFT) != 0u;
    let is_same = atomicLoad(&table[0]) != 0u && !(is_glossy && (light_cut_grid.flags & LIGHT_EYE_MOVED) != 0u);
    let built_points = atomicLoad(&table[at + 3u]);
    if is_same && built_points != 0u && points(at) <= built_points {
        atomicAdd(&table[KEPT], 1u);
        forget_points(at);
        return;
    }
    // It has no cut until it is built.
    atomicStore(&table[at + 3u], 0u);
    if atomicLoad(&table[at + 2u]) == 0u {
        let first = atomicAdd(&table[FIRST_FREE], 1u);
        if bitcast<i32>(first - atomicLoad(&table[USABLE])) >= 0 {
            atomicAdd(&table[REFUSED], 1u);
            forget_points(at);
            return;
        }
        atomicStore(&table[at + 2u], atomicLoad(&table[light_cut_grid.free_rows + (first & last_row())]));
    }
    let number = atomicAdd(&table[LISTED], 1u);
    atomicStore(&table[light_cut_grid.listed + number], slot);
}

// Ends the list: one invocation.
@compute @workgroup_size(1)
fn cut_dispatch() {
    let listed = atomicExchange(&table[LISTED], 0u);
    report[0] = min(listed, 65535u);
    report[1] = (listed + 65534u) / 65535u;
    report[2] = 1u;
    report[3] = 0u;
    atomicStore(&table[TO_BUILD], listed);
    atomicStore(&table[BUILT], listed);
    for (var i = 0u; i < 6u; i++) {
        report[4u + i] = atomicExchange(&table[MARKED + i], 0u);
    }
    // Requests that found no row have passed the end.
    let usable = atomicLoad(&table[USABLE]);
    if bitcast<i32>(atomicLoad(&table[FIRST_FREE]) - usable) > 0 {
        atomicStore(&table[FIRST_FREE], usable);
    }
    atomicStore(&table[USABLE], atomicLoad(&table[END_OF_FREE]));
    // From here on shaders may use the cuts.
    atomicStore(&table[0], 1u);
}

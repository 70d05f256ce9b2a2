// Lists the cells to look at and to build, and gives rows to them and back. One invocation for each slot of the table.
// Twin of `CutTable::builds`.
//
// The head of the marks: the number of listed cells to build, and of those to look at; the first and the end of the
// free rows in their ring, and where those end that were free before this frame; the number of cells to build; how
// many builds there were since the eye moved; the number of cells to look at; counters, of which LIGHT_LOST_MARKS is
// the last; and the eye of the last build.

@group(0) @binding(1) var<storage, read_write> light_cuts: LightCutTable;
// As in mark.wgsl.
@group(0) @binding(2) var<storage, read_write> light_marks: array<atomic<u32>>;
// What the build is dispatched with, and counters of the last build in words 4 to 9.
@group(0) @binding(3) var<storage, read_write> report: array<u32>;

const LISTED: u32 = 0u;
const LISTED_LOOKS: u32 = 1u;
const FIRST_FREE: u32 = 2u;
const END_OF_FREE: u32 = 3u;
const USABLE: u32 = 4u;
const TO_BUILD: u32 = 5u;
const EYE_REST: u32 = 6u;
const TO_LOOK_AT: u32 = 7u;
const MARKED: u32 = 8u;
const BUILT: u32 = 9u;
const KEPT: u32 = 10u;
const RARE: u32 = 11u;
const REFUSED: u32 = 12u;
const BUILT_EYE: u32 = 14u;

// Whether the eye is elsewhere than in the last build.
fn has_eye_moved() -> bool {
    let eye = bitcast<vec3<u32>>(light_cuts.grid.eye);
    let built_eye = vec3(
        atomicLoad(&light_marks[BUILT_EYE]), atomicLoad(&light_marks[BUILT_EYE + 1u]),
        atomicLoad(&light_marks[BUILT_EYE + 2u]),
    );
    return any(eye != built_eye);
}

fn last_row() -> u32 {
    return light_cuts.grid.listed - light_cuts.grid.free_rows - 1u;
}

// Takes the cut of a slot away.
fn give_back(slot: u32) {
    let at = LIGHT_CUT_HEAD + LIGHT_SLOT_WORDS * slot;
    light_cuts.quads[1u + slot] = vec4(0u);
    atomicStore(&light_marks[at + 3u], 0u);
    let row = atomicExchange(&light_marks[at + 2u], 0u);
    if row != 0u {
        let end = atomicAdd(&light_marks[END_OF_FREE], 1u);
        atomicStore(&light_marks[light_cuts.grid.free_rows + (end & last_row())], row);
    }
}

// Returns the number of points, and forgets them.
fn forget_points(at: u32) {
    for (var i = 0u; i < LIGHT_CELL_POINTS; i++) {
        atomicStore(&light_marks[at + 9u + i], 0u);
    }
}

fn points(at: u32) -> u32 {
    var count = 0u;
    for (var i = 0u; i < LIGHT_CELL_POINTS; i++) {
        count += select(0u, 1u, atomicLoad(&light_marks[at + 9u + i]) != 0u);
    }
    return count;
}

@compute @workgroup_size(64)
fn cut_list(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let slot = id.x + id.y * groups.x * 64u;
    if slot > light_cuts.grid.last_slot {
        return;
    }
    let at = LIGHT_CUT_HEAD + LIGHT_SLOT_WORDS * slot;
    if atomicLoad(&light_marks[at]) == 0u {
        return;
    }
    let count = atomicExchange(&light_marks[at + 1u], 0u);
    if count == 0u {
        give_back(slot);
        atomicStore(&light_marks[at], 0u);
        return;
    }
    atomicAdd(&light_marks[MARKED], 1u);
    if count < light_cuts.grid.min_marks {
        atomicAdd(&light_marks[RARE], 1u);
        give_back(slot);
        forget_points(at);
        return;
    }
    let is_glossy = (atomicLoad(&light_marks[at + 7u]) >> LIGHT_GLOSS_SHIFT) != 0u;
    let is_calm = light_cuts.quads[0].x > LIGHT_TURNS
        && !(is_glossy && (has_eye_moved() || atomicLoad(&light_marks[EYE_REST]) < LIGHT_TURNS));
    let built_points = atomicLoad(&light_marks[at + 3u]);
    if built_points != 0u && points(at) <= built_points {
        if is_calm {
            atomicAdd(&light_marks[KEPT], 1u);
            forget_points(at);
        } else {
            let number = atomicAdd(&light_marks[LISTED_LOOKS], 1u);
            atomicStore(&light_marks[2u * light_cuts.grid.listed - light_cuts.grid.free_rows + number], slot);
        }
        return;
    }
    // It has no cut until it is built.
    light_cuts.quads[1u + slot] = vec4(0u);
    atomicStore(&light_marks[at + 3u], 0u);
    if atomicLoad(&light_marks[at + 2u]) == 0u {
        let first = atomicAdd(&light_marks[FIRST_FREE], 1u);
        if bitcast<i32>(first - atomicLoad(&light_marks[USABLE])) >= 0 {
            atomicAdd(&light_marks[REFUSED], 1u);
            forget_points(at);
            return;
        }
        let row = atomicLoad(&light_marks[light_cuts.grid.free_rows + (first & last_row())]);
        atomicStore(&light_marks[at + 2u], row);
        light_cuts.quads[light_cuts.grid.first_row + (row - 1u) * LIGHT_ROW_QUADS + LIGHT_ROW_STATE].y = 0u;
    }
    let number = atomicAdd(&light_marks[LISTED], 1u);
    atomicStore(&light_marks[light_cuts.grid.listed + number], slot);
}

fn dispatch_of(groups: u32) {
    report[0] = min(groups, 65535u);
    report[1] = (groups + 65534u) / 65535u;
    report[2] = 1u;
    report[3] = 0u;
}

// Ends the list of cells to look at: one invocation.
@compute @workgroup_size(1)
fn cut_looks() {
    let listed = atomicExchange(&light_marks[LISTED_LOOKS], 0u);
    dispatch_of(listed);
    atomicStore(&light_marks[TO_LOOK_AT], listed);
}

// Ends the list of cells to build: one invocation.
@compute @workgroup_size(1)
fn cut_dispatch() {
    let listed = atomicExchange(&light_marks[LISTED], 0u);
    dispatch_of(listed);
    atomicStore(&light_marks[TO_BUILD], listed);
    atomicStore(&light_marks[BUILT], listed);
    for (var i = 0u; i < 6u; i++) {
        report[4u + i] = atomicExchange(&light_marks[MARKED + i], 0u);
    }
    // Requests that found no row have passed the end.
    let usable = atomicLoad(&light_marks[USABLE]);
    if bitcast<i32>(atomicLoad(&light_marks[FIRST_FREE]) - usable) > 0 {
        atomicStore(&light_marks[FIRST_FREE], usable);
    }
    atomicStore(&light_marks[USABLE], atomicLoad(&light_marks[END_OF_FREE]));
    let rest = atomicLoad(&light_marks[EYE_REST]);
    atomicStore(&light_marks[EYE_REST], select(min(rest, LIGHT_TURNS) + 1u, 0u, has_eye_moved()));
    let eye = bitcast<vec3<u32>>(light_cuts.grid.eye);
    for (var i = 0u; i < 3u; i++) {
        atomicStore(&light_marks[BUILT_EYE + i], eye[i]);
    }
    // From here on shaders may use the cuts.
    light_cuts.quads[0] = vec4(min(light_cuts.quads[0].x, LIGHT_TURNS) + 1u, 0u, 0u, 0u);
}

// Chooses from the cut that the points of a cell share. Twin of src/sampling/cuts/placed.rs.
//
// A row has 104 quads: the number of nodes, that of the points it was made for, what directional lights
// bring over what trees do, and the sum of all units; the running sum at the end of each sixteenth
// child; the nodes as instance and index; the running sums of all children; and what cut_keep.wgsl reads.

@group(LIGHT_GROUP) @binding(5) var<storage, read> light_cuts: LightCutTable;

// The row of the cut of a shading point's cell or of its coarse cell, as its first quad; 0 if there is none.
fn light_shared_cut(shading_point: LightShadingPoint) -> u32 {
    // Cuts are void after a change of the world.
    if light_cuts.quads[0].x == 0u {
        return 0u;
    }
    var row = 0u;
    for (var coarser = 0u; coarser <= LIGHT_COARSER && row == 0u; coarser += LIGHT_COARSER) {
        row = light_row_of_cell(light_cut_cell(shading_point, coarser));
    }
    return row;
}

fn light_row_of_cell(cell: LightCutCell) -> u32 {
    if cell.kind == LIGHT_NO_CELL {
        return 0u;
    }
    let keys = light_cell_keys(cell);
    for (var step = 0u; step < LIGHT_PROBES; step++) {
        let slot = light_cuts.quads[1u + ((keys.x + step) & light_cuts.grid.last_slot)];
        if slot.x == keys.y {
            return slot.y;
        }
    }
    return 0u;
}

// Twin of `PlacedCut::total`.
fn light_shared_total(row: u32, directional_lux: f32) -> f32 {
    let directional = max(bitcast<f32>(light_cuts.quads[row].z), LIGHT_MIN_SIDE);
    return select(1.0, directional_lux / directional, directional_lux > 0.0);
}

// How many running sums are at most `unit`.
fn light_sums_passed(sums: vec4<u32>, unit: u32) -> u32 {
    let passed = select(vec4(0u), vec4(1u), sums <= vec4(unit));
    return (passed.x + passed.y) + (passed.z + passed.w);
}

// How many of sixteen running sums are at most `unit`.
fn light_sixteen_passed(at: u32, unit: u32) -> u32 {
    return light_sums_passed(light_cuts.quads[at], unit) + light_sums_passed(light_cuts.quads[at + 1u], unit)
        + light_sums_passed(light_cuts.quads[at + 2u], unit) + light_sums_passed(light_cuts.quads[at + 3u], unit);
}

// The running sum of units up to a child.
fn light_shared_sum(row: u32, child: u32) -> u32 {
    return light_cuts.quads[row + LIGHT_ROW_SUMS + child / 4u][child % 4u];
}

// The first unit of a child, and the number of its units.
fn light_units(row: u32, child: u32) -> vec2<u32> {
    var before = 0u;
    if child != 0u {
        before = light_shared_sum(row, child - 1u);
    }
    return vec2(before, light_shared_sum(row, child) - before);
}

// A candidate that was chosen.
struct LightShared {
    place: LightPlace,
    pmf: f32,
    // How far the random number lies inside the candidate's part of the line from 0 to 1.
    offset: f32,
}

// Twin of `PlacedCut::choose`.
fn light_choose_shared(row: u32, u: f32) -> LightShared {
    let total = light_cuts.quads[row].w;
    let point = u * f32(total);
    let unit = min(u32(point), total - 1u);
    let block = min(light_sixteen_passed(row + 1u, unit), 15u);
    let child = 16u * block + light_sixteen_passed(row + LIGHT_ROW_SUMS + 4u * block, unit);
    let units = light_units(row, child);
    let node = child / LIGHT_WIDTH;
    let pair = light_cuts.quads[row + LIGHT_ROW_NODES + node / 2u];
    let parent = select(pair.xy, pair.zw, (node & 1u) != 0u);
    let place = light_child_place(LightPlace(parent.x, parent.y), child % LIGHT_WIDTH);
    let inverse = 1.0 / f32(total);
    return LightShared(place, f32(units.y) * inverse, (point - f32(units.x)) * inverse);
}

// The probability of a child of a node; below 0 if the node's children are no candidates. Twin of
// `PlacedCut::pmf`.
fn light_shared_pmf(row: u32, place: LightPlace, slot: u32) -> f32 {
    let node = vec4(place.instance, place.index, place.instance, place.index);
    for (var i = 0u; i < LIGHT_SHARED_NODES / 2u; i++) {
        let is_same = light_cuts.quads[row + LIGHT_ROW_NODES + i] == node;
        if (is_same.x && is_same.y) || (is_same.z && is_same.w) {
            let index = 2u * i + select(1u, 0u, is_same.x && is_same.y);
            return f32(light_units(row, index * LIGHT_WIDTH + slot).y) / f32(light_cuts.quads[row].w);
        }
    }
    return -1.0;
}

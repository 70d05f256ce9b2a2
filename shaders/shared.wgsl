// Chooses from the cut that the points of a cell share. Twin of src/sampling/cuts/placed.rs.
//
// A row has 104 quads: the number of nodes and, in the upper half of the word, of the points it was made for, what
// candidates bring that are not contested, what directional lights bring over what trees do, and the sum of all units;
// the running sum at the end of each sixteenth
// child; the nodes as instance and index; the running sums of all children; and what cut_keep.wgsl reads.

@group(LIGHT_GROUP) @binding(5) var<storage, read> light_cuts: LightCutTable;

// The row of the cut of a shading point's cell or of its coarse cell, as its first quad; 0 if there is none. Then a
// byte for each contested node, and for each of these the bits of its children that are candidates.
fn light_shared_cut(shading_point: LightShadingPoint) -> vec3<u32> {
    // Cuts are void after a change of the world.
    if light_cuts.quads[0].x == 0u {
        return vec3(0u);
    }
    var found = vec3(0u);
    for (var coarser = 0u; coarser <= LIGHT_COARSER && found.x == 0u; coarser += LIGHT_COARSER) {
        found = light_row_of_cell(light_cut_cell(shading_point, coarser));
    }
    return found;
}

fn light_row_of_cell(cell: LightCutCell) -> vec3<u32> {
    if cell.kind == LIGHT_NO_CELL {
        return vec3(0u);
    }
    let keys = light_cell_keys(cell);
    for (var step = 0u; step < LIGHT_PROBES; step++) {
        let slot = light_cuts.quads[1u + ((keys.x + step) & light_cuts.grid.last_slot)];
        if slot.x == keys.y {
            return slot.yzw;
        }
    }
    return vec3(0u);
}

// Twin of `WeighedCut::total`.
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

fn light_row_node(row: u32, index: u32) -> LightPlace {
    let pair = light_cuts.quads[row + LIGHT_ROW_NODES + index / 2u];
    let place = select(pair.xy, pair.zw, (index & 1u) != 0u);
    return LightPlace(place.x, place.y);
}

// A candidate that was chosen.
struct LightShared {
    place: LightPlace,
    pmf: f32,
    // How far the random number lies inside the candidate's part of the line from 0 to 1.
    offset: f32,
}

// Chooses a candidate that is not contested. Twin of `WeighedCut::choose_shared`.
fn light_choose_shared(row: u32, u: f32) -> LightShared {
    let total = light_cuts.quads[row].w;
    // All candidates are contested.
    if total == 0u {
        return LightShared(LightPlace(0u, LIGHT_LEAF), 0.0, 0.0);
    }
    let point = u * f32(total);
    let unit = min(u32(point), total - 1u);
    let block = min(light_sixteen_passed(row + 1u, unit), 15u);
    let child = 16u * block + light_sixteen_passed(row + LIGHT_ROW_SUMS + 4u * block, unit);
    let units = light_units(row, child);
    let place = light_child_place(light_row_node(row, child / LIGHT_WIDTH), child % LIGHT_WIDTH);
    let inverse = 1.0 / f32(total);
    return LightShared(place, f32(units.y) * inverse, (point - f32(units.x)) * inverse);
}

// The place of a node in a row; LIGHT_SHARED_NODES if its children are no candidates.
fn light_row_index(row: u32, place: LightPlace) -> u32 {
    let node = vec4(place.instance, place.index, place.instance, place.index);
    for (var i = 0u; i < LIGHT_SHARED_NODES / 2u; i++) {
        let is_same = light_cuts.quads[row + LIGHT_ROW_NODES + i] == node;
        if (is_same.x && is_same.y) || (is_same.z && is_same.w) {
            return 2u * i + select(1u, 0u, is_same.x && is_same.y);
        }
    }
    return LIGHT_SHARED_NODES;
}

// Whether each point weighs a child of a node itself. Twin of `SharedCut::is_contested`.
fn light_is_contested(contested: vec2<u32>, index: u32, slot: u32) -> bool {
    for (var k = 0u; k < LIGHT_CONTESTED; k++) {
        let bytes = extractBits(contested, 8u * k, 8u);
        if bytes.x == index && ((bytes.y >> slot) & 1u) != 0u {
            return true;
        }
    }
    return false;
}

// The probability of a child of a node among those that are not contested.
fn light_shared_pmf(row: u32, index: u32, slot: u32) -> f32 {
    let units = light_units(row, index * LIGHT_WIDTH + slot).y;
    return select(0.0, f32(units) / f32(light_cuts.quads[row].w), units != 0u);
}

// What a row says about the nodes that it was made for, so that a later build can tell whether it still suits. Behind the
// running sums: for each node a byte with the child, counted through all nodes, that it was, or LIGHT_SKY_ROOT; the sum of
// the names of all nodes, how many builds the cell has had a row for, the direction from a glossy cell to the
// eye, and the state of the sky; for each child a byte with its flux in half octaves. Twin of src/sampling/cuts/keep.rs.

// The first quad of a row; rows are counted from 1.
fn row_quad(number: u32) -> u32 {
    return light_cuts.grid.first_row + (number - 1u) * LIGHT_ROW_QUADS;
}

// The cell that a slot of light_marks holds.
fn row_cell(at: u32) -> LightCutCell {
    var cell: LightCutCell;
    cell.corner =
        vec3(atomicLoad(&light_marks[at + 4u]), atomicLoad(&light_marks[at + 5u]), atomicLoad(&light_marks[at + 6u]));
    cell.kind = atomicLoad(&light_marks[at + 7u]);
    cell.mask = atomicLoad(&light_marks[at + 8u]);
    return cell;
}

// Four neighbouring children of a node.
struct RowChildren {
    // A byte for each: see flux_step in src/sampling/cuts/keep.rs.
    flux: u32,
    // A bit for each that may send light.
    lit: u32,
    // Their part of the name of the node.
    name: u32,
}

fn row_children(place: LightPlace, first_slot: u32, mask: u32) -> RowChildren {
    let in_top = place.instance == LIGHT_NO_INSTANCE;
    let at = place.index * LIGHT_NODE_QUADS;
    var found: RowChildren;
    for (var i = 0u; i < 4u; i++) {
        let words = light_quad(in_top, at + LIGHT_NODE_CHILDREN + first_slot + i);
        let flux = words.w >> 16u;
        found.flux |= ((flux >> 6u) & 0xffu) << (8u * i);
        found.lit |= select(0u, 1u << i, flux != 0u && mask != 0u);
        found.name += light_hash(words.x ^ light_hash(first_slot + i));
    }
    // #if MASKS
    found.lit &= light_met_children(in_top, place.index, mask) >> first_slot;
    // #endif
    if in_top {
        found.name = select(0u, light_quad(true, at + LIGHT_NODE_TAIL).z, first_slot == 0u);
    }
    return found;
}

// A direction in 30 bits; 0 for none.
fn row_direction(direction: vec3<f32>) -> u32 {
    let steps = vec3<u32>(round(direction * 511.0) + 512.0);
    return select(0u, (steps.x << 20u) | (steps.y << 10u) | steps.z, any(direction != vec3(0.0)));
}

fn row_direction_of(bits: u32) -> vec3<f32> {
    return (vec3<f32>((vec3(bits) >> vec3(20u, 10u, 0u)) & vec3(1023u)) - 512.0) / 511.0;
}

// Twin of `SkyState`: how the sky is turned in three bytes, and a byte with half octaves of its brightness.
fn row_sky() -> u32 {
    var state = 0u;
    // #if SKY
    if light_params.sky != LIGHT_NO_INSTANCE {
        let placed = light_instance(light_params.sky);
        let axis = vec3(1.0, 2.0, 3.0);
        let turned = vec3(
            dot(placed.to_world[0].xyz, axis), dot(placed.to_world[1].xyz, axis), dot(placed.to_world[2].xyz, axis),
        );
        let steps = vec3<u32>(round(light_normalize_or_zero(turned) * 127.0) + 128.0);
        var brightness = 1.0;
        // #if FACTORS
        brightness = light_brightness(placed.factor);
        // #endif
        state = (steps.x << 24u) | (steps.y << 16u) | (steps.z << 8u) | ((bitcast<u32>(brightness) >> 22u) & 0xffu);
    }
    // #endif
    return state;
}

// The cosine between two turned skies.
fn row_sky_cosine(a: u32, b: u32) -> f32 {
    let shifts = vec3(24u, 16u, 8u);
    let turns = vec3<f32>((vec3(a) >> shifts) & vec3(255u)) - 128.0;
    let other = vec3<f32>((vec3(b) >> shifts) & vec3(255u)) - 128.0;
    return dot(light_normalize_or_zero(turns), light_normalize_or_zero(other));
}

// How far a byte is above another one, modulo 2^8.
fn row_steps(now: u32, known: u32) -> i32 {
    return extractBits(bitcast<i32>(now - known), 0u, 8u);
}

// The direction from the middle of a glossy cell to the eye; 0 for a matte one.
fn row_toward(cell: LightCutCell, center: vec3<f32>) -> vec3<f32> {
    let toward = light_cuts.grid.eye - center;
    let is_glossy = (cell.kind >> LIGHT_GLOSS_SHIFT) != 0u && light_cuts.grid.has_eye != 0u;
    return select(vec3(0.0), light_normalize_or_zero(toward), is_glossy);
}

// The position in the middle of a cell. Twin of `CutGrid::center`.
fn row_center(cell: LightCutCell) -> vec3<f32> {
    return row_position(cell, vec3(f32(1u << (LIGHT_PLACE_BITS - 1u))));
}

// `place` is in units of the cell's level, from its corner.
fn row_position(cell: LightCutCell, place: vec3<f32>) -> vec3<f32> {
    let level = cell.kind & 15u;
    let corner = (cell.corner << vec3(LIGHT_PLACE_BITS + level)) - light_cuts.grid.first;
    let units = vec3<f32>(bitcast<vec3<i32>>(corner)) + place * f32(1u << level);
    return units * light_cuts.grid.unit - light_cuts.grid.offset;
}

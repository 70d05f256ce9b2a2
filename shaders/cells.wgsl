// The cell of a shading point, whose points share a cut. Twin of src/sampling/cuts/cell.rs, which explains
// it and owns the constants. src/plan/cuts owns the buffers.

const LIGHT_NO_CELL: u32 = 0xffffffffu;

// The cell of a shading point, with an edge that is doubled `coarser` times more; LIGHT_NO_CELL above the largest.
// Twin of `CutGrid::cell` and `CutGrid::coarse_cell`.
fn light_cut_cell(shading_point: LightShadingPoint, coarser: u32) -> LightCutCell {
    let toward = light_cuts.grid.eye - shading_point.position;
    let exponent = bitcast<u32>(dot(toward, toward) * light_cuts.grid.edges_sq) >> 23u;
    let seen = min((max(exponent, 127u) - 127u) / 2u, LIGHT_CELL_LEVELS);
    let level = coarser + select(LIGHT_STILL_LEVEL, seen, light_cuts.grid.has_eye != 0u);
    let units = floor((shading_point.position + light_cuts.grid.offset) * light_cuts.grid.units_per_metre);
    let limited = clamp(units, vec3(-LIGHT_MAX_COORDINATE), vec3(LIGHT_MAX_COORDINATE));
    let place = bitcast<vec3<i32>>(bitcast<vec3<u32>>(vec3<i32>(limited)) + light_cuts.grid.first);
    var cell: LightCutCell;
    cell.corner = bitcast<vec3<u32>>(place >> vec3(LIGHT_PLACE_BITS + level));
    let within = bitcast<vec3<u32>>(place >> vec3(level)) & vec3((1u << LIGHT_PLACE_BITS) - 1u);
    let bits = (((within.x << LIGHT_PLACE_BITS) | within.y) << LIGHT_PLACE_BITS) | within.z;
    let random = light_hash(bits ^ light_hash(cell.corner.x ^ light_hash(cell.corner.y ^ light_hash(cell.corner.z))));
    let normal = light_cell_normal(shading_point.normal, random);
    cell.kind = level | (normal.x << 4u);
    cell.mask = 0xffffffffu;
    // #if MASKS
    cell.mask = shading_point.mask;
    // #endif
    // #if GLOSSY
    cell.kind = select(cell.kind | (shading_point.cell_gloss << LIGHT_GLOSS_SHIFT), LIGHT_NO_CELL,
        shading_point.cell_gloss == LIGHT_NO_CELL);
    // #endif
    // #if SEGMENTS
    cell.kind = select(cell.kind, LIGHT_NO_CELL, light_is_segment(shading_point));
    // #endif
    let is_too_coarse = coarser != 0u && (light_cuts.grid.has_eye == 0u || level > LIGHT_CELL_LEVELS);
    cell.kind = select(cell.kind, LIGHT_NO_CELL, is_too_coarse);
    cell.which = random % LIGHT_CELL_POINTS;
    cell.marks_coarse = select(0u, 1u, (random / LIGHT_CELL_POINTS) % LIGHT_COARSE_MARKS == 0u);
    let content = (bits << (2u * LIGHT_SLOPE_BITS)) | normal.y;
    cell.word = max(light_scrambled((content << LIGHT_RANDOM_BITS) | (random >> (32u - LIGHT_RANDOM_BITS))), 1u);
    return cell;
}

// Twin of `scrambled`.
fn light_scrambled(content: u32) -> u32 {
    var word = (content ^ (content >> 16u)) * 0x7feb352du;
    word = (word ^ (word >> 15u)) * 0x846ca68bu;
    return word ^ (word >> 16u);
}

// The class of a normal, and its slopes within the class. Twin of `normal_bits`.
fn light_cell_normal(normal: vec3<f32>, random: u32) -> vec2<u32> {
    let side = light_side(normal);
    if side == 6u {
        return vec2(LIGHT_VOLUME_CLASS, 0u);
    }
    let axis = side / 2u;
    let all_slopes = vec2(normal[(axis + 1u) % 3u], normal[(axis + 2u) % 3u]) / abs(normal[axis]);
    let slopes = all_slopes * LIGHT_SLOPE_CLASSES;
    let normal_class = clamp(round(slopes), vec2(-1.0), vec2(1.0));
    let fraction = vec2<f32>(vec2(light_hash(random ^ 1u), light_hash(random ^ 2u)) >> vec2(8u)) * LIGHT_U_STEP;
    let raised = floor((slopes - normal_class) * LIGHT_SLOPE_STEPS + LIGHT_SLOPE_ZERO + fraction);
    let steps = vec2<u32>(clamp(raised, vec2(0.0), vec2(2.0 * LIGHT_SLOPE_ZERO + 1.0)));
    let classes = vec2<u32>(normal_class + 1.0);
    return vec2(9u * side + 3u * classes.x + classes.y, (steps.x << LIGHT_SLOPE_BITS) | steps.y);
}

// Where to look in the table, and what tells cells apart there. Twin of `CutCell::keys`.
fn light_cell_keys(cell: LightCutCell) -> vec2<u32> {
    let x = cell.corner.x;
    let last = light_hash(cell.corner.z ^ light_hash(cell.kind ^ light_hash(cell.mask)));
    let first = light_hash(x ^ light_hash(cell.corner.y ^ last));
    return vec2(first, max(light_hash(first ^ light_hash(x ^ LIGHT_TAG_SEED)), 1u));
}

// #if GLOSSY
// Twin of `CutGrid::gloss_class`; LIGHT_NO_CELL for points that share no cells.
fn light_cell_gloss(
    shading_point: LightShadingPoint, view: vec3<f32>, roughness: f32, specular: f32, diffuse: f32,
) -> u32 {
    if all(shading_point.normal == vec3(0.0)) {
        return 0u;
    }
    let toward = light_cuts.grid.eye - shading_point.position;
    let is_seen = dot(toward, view) >= LIGHT_VIEW_COSINE * (length(toward) * length(view));
    if light_cuts.grid.has_eye == 0u || !is_seen {
        return LIGHT_NO_CELL;
    }
    let steps = u32(round(clamp(roughness, 0.0, 1.0) * LIGHT_ROUGHNESS_STEPS));
    let ratio = clamp(log2(specular / max(diffuse, 1.0e-6)), LIGHT_LEAST_RATIO, LIGHT_GREATEST_RATIO);
    return (1u + steps) | (u32(round(ratio - LIGHT_LEAST_RATIO)) << 8u);
}
// #endif

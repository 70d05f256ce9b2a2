// Learnt visibility: which groups of lights reach the cell of a shading point. Twin of
// src/visibility/cell.rs and src/sampling/learn.rs, which explain it. src/plan/cuts owns the buffers.
//
// Behind the rows of light_cuts: four quads of parameters; the tags and the idle frames of all rows, four rows in a
// quad; the shares of all rows, four in a word. Rows of cells come first, then those of blocks.
// At the end of light_marks, the records: for each row the tag that claims it; for each row whether it has counts, as
// one more than the row of its block; for each row and group the hidden and the visible samples.

fn light_learnt(quad: u32) -> vec4<u32> {
    return light_cuts.quads[light_cuts.grid.learnt + quad];
}

// Finds the row of a cell or block. Twin of `CellKey`.
struct LightCellKey {
    tag: u32,
    // The quad of the bucket's tags.
    bucket: u32,
}

// The cell of a shading point. Twin of `Cell`.
struct LightCell {
    key: LightCellKey,
    block: LightCellKey,
    // The row in which something is known, or LIGHT_NO_ROW.
    row: u32,
    // From the middle of the block's groups to the shading point, in metres.
    from_center: vec3<f32>,
}

const LIGHT_NO_ROW: u32 = 0xffffffffu;

// The numbers of rows of cells and of blocks; 0 while nothing is learnt.
fn light_row_counts() -> vec2<u32> {
    return vec2(light_learnt(0).z, light_learnt(1).w);
}

// Twin of `CellKey::new`, in a bucket of some rows.
fn light_cell_key(c: vec3<u32>, side: u32, first_row: u32, rows: u32) -> LightCellKey {
    let first = light_hash(c.x ^ light_hash(c.y ^ light_hash(c.z ^ light_hash(side))));
    let tag = light_hash(first ^ light_hash(c.x ^ LIGHT_TAG_SEED)) | LIGHT_LEARNT_BIT | LIGHT_USED_BIT;
    return LightCellKey(tag, (first_row + (first & (rows - LIGHT_WAYS))) / LIGHT_WAYS);
}

// The row of a cell or block, or LIGHT_NO_ROW. With LIGHT_LEARNT_BIT as `ignored`, also one that is not read yet.
fn light_learnt_row(key: LightCellKey, ignored: u32) -> u32 {
    let tags = light_learnt(LIGHT_TABLE_HEAD + key.bucket) | vec4(ignored);
    var row = LIGHT_NO_ROW;
    for (var i = 0u; i < LIGHT_WAYS; i++) {
        if tags[i] == key.tag && row == LIGHT_NO_ROW {
            row = key.bucket * LIGHT_WAYS + i;
        }
    }
    return row;
}

// Twin of `CellGrid::cell` and `VisibilityTable::learnt_row`.
fn light_cell(shading_point: LightShadingPoint) -> LightCell {
    var cell = LightCell(LightCellKey(0u, 0u), LightCellKey(0u, 0u), LIGHT_NO_ROW, vec3(0.0));
    let rows = light_row_counts();
    if rows.x == 0u {
        return cell;
    }
    let grid = bitcast<vec4<f32>>(light_learnt(0));
    let place = shading_point.position + bitcast<vec3<f32>>(light_learnt(1).xyz);
    let cube = floor(place * grid.y);
    let limited = clamp(cube, vec3(-LIGHT_MAX_COORDINATE), vec3(LIGHT_MAX_COORDINATE));
    let at = bitcast<vec3<u32>>(vec3<i32>(limited)) + light_learnt(2).xyz;
    let side = light_side(shading_point.normal);
    let block = bitcast<vec3<u32>>(bitcast<vec3<i32>>(at) >> vec3(LIGHT_BLOCK_BITS));
    let in_block = vec3<f32>(at & vec3((1u << LIGHT_BLOCK_BITS) - 1u));
    cell.key = light_cell_key(at, side, 0u, rows.x);
    cell.block = light_cell_key(block, side, rows.x, rows.y);
    cell.from_center = place - (cube - in_block + LIGHT_BLOCK_MIDDLE) * grid.x;
    cell.row = light_learnt_row(cell.key, 0u);
    if cell.row == LIGHT_NO_ROW {
        cell.row = light_learnt_row(cell.block, 0u);
    }
    return cell;
}

// The group of a cluster. `toward` is the vector from the middle of the block to the mean position
// of the cluster, in metres. Twin of `bins`.
fn light_bin(toward: vec3<f32>) -> u32 {
    let edge = bitcast<f32>(light_learnt(0).x);
    let size = abs(toward);
    let dist = min(max(max(size.x, size.y), max(size.z, edge)), LIGHT_MAX_DIST);
    let exponent = bitcast<u32>(dist) >> 23u;
    let steps_per_metre = bitcast<f32>((255u - exponent) << 23u);
    let step = bitcast<vec3<u32>>(toward * steps_per_metre + LIGHT_ROUNDING) & vec3((1u << LIGHT_COORDINATE_BITS) - 1u);
    let key = (((exponent << LIGHT_COORDINATE_BITS) | step.x) << LIGHT_COORDINATE_BITS) | step.y;
    return light_hash((key << LIGHT_COORDINATE_BITS) | step.z) >> LIGHT_BIN_SHIFT;
}

// The group of a child of a node in an instance's tree, or in the top level for LIGHT_NO_INSTANCE.
// Twin of `bin_of_child`.
fn light_child_bin(
    packed: LightPackedChild, view: LightNodeView, instance: u32, local: LightLocalShadingPoint,
    from_center: vec3<f32>,
) -> u32 {
    var toward = light_to_mean(packed, view);
    if instance != LIGHT_NO_INSTANCE {
        toward = light_linear(light_instance(instance).to_world, toward);
        // #if SKY
        toward *= select(1.0, LIGHT_SKY_DIST, instance == light_params.sky);
        // #endif
    }
    // #if NON_RIGID
    if local.scaled_instance != LIGHT_NO_INSTANCE {
        toward -= light_linear(light_axes(light_instance(instance)), local.position);
    }
    // #endif
    return light_bin(toward + from_center);
}

// The learnt share of a group.
fn light_learnt_share(row: u32, bin: u32) -> f32 {
    let byte = row * LIGHT_BINS + bin;
    let rows = light_row_counts();
    let quad = light_learnt(LIGHT_TABLE_HEAD + (rows.x + rows.y) / 2u + byte / 16u);
    return (f32((quad[(byte / 4u) % 4u] >> (8u * (byte % 4u))) & 0xffu) + 1.0) * (1.0 / 256.0);
}

// The learnt share of a child; 1 where nothing is learnt. Twin of `LearntCell::shares`.
fn light_child_share(
    packed: LightPackedChild, view: LightNodeView, instance: u32, local: LightLocalShadingPoint, cell: LightCell,
) -> f32 {
    if cell.row == LIGHT_NO_ROW {
        return 1.0;
    }
    return light_learnt_share(cell.row, light_child_bin(packed, view, instance, local, cell.from_center));
}

// From the shading point, or the middle of a segment, to a sample's point on a light. Twin of `Incident::toward`.
fn light_toward_sample(shading_point: LightShadingPoint, chosen: LightSample) -> vec3<f32> {
    var dist = chosen.dist;
    // #if SKY
    dist = min(dist, LIGHT_SKY_DIST);
    // #endif
    var toward = chosen.direction * dist;
    // #if SEGMENTS
    if light_is_segment(shading_point) {
        toward += shading_point.segment * (light_along / length(shading_point.segment) - 0.5);
    }
    // #endif
    return toward;
}

// The learnt share of the place of a sample's light. Twin of `LearntCell::share_toward`.
fn light_place_share(cell: LightCell, shading_point: LightShadingPoint, candidate: LightSample) -> f32 {
    if cell.row == LIGHT_NO_ROW || candidate.instance == LIGHT_DIRECTIONAL {
        return 1.0;
    }
    return light_learnt_share(cell.row, light_bin(light_toward_sample(shading_point, candidate) + cell.from_center));
}

// The row of a cell or block. If there is none, asks for one from the next frame on. Twin of
// `VisibilityTable::row_or_claim`.
fn light_row_or_claim(key: LightCellKey) -> u32 {
    let found = light_learnt_row(key, LIGHT_LEARNT_BIT);
    if found != LIGHT_NO_ROW {
        return found;
    }
    let rows = light_row_counts();
    let tags = light_learnt(LIGHT_TABLE_HEAD + key.bucket);
    let idle = light_learnt(LIGHT_TABLE_HEAD + (rows.x + rows.y) / LIGHT_WAYS + key.bucket);
    var chosen = LIGHT_WAYS;
    var longest = LIGHT_MIN_IDLE - 1u;
    for (var i = 0u; i < LIGHT_WAYS; i++) {
        if idle[i] > longest {
            chosen = i;
            longest = idle[i];
        }
    }
    // From the last to the first free row that the CPU would find.
    for (var i = LIGHT_WAYS; i > 0u; i--) {
        let way = (key.tag / 4u + i - 1u) % LIGHT_WAYS;
        if tags[way] == 0u {
            chosen = way;
        }
    }
    if chosen < LIGHT_WAYS {
        atomicMax(&light_marks[light_cuts.grid.records + key.bucket * LIGHT_WAYS + chosen], key.tag);
    }
    return LIGHT_NO_ROW;
}

// The row that counts the records of a cell in this frame, or LIGHT_NO_ROW. Twin of
// `VisibilityTable::row_to_record`.
fn light_row_to_record(cell: LightCell) -> u32 {
    let block = light_row_or_claim(cell.block);
    var row = light_row_or_claim(cell.key);
    if row == LIGHT_NO_ROW {
        row = block;
    }
    if row != LIGHT_NO_ROW {
        let rows = light_row_counts();
        // One more than LIGHT_NO_ROW would be 0.
        let link = select(block + 1u, LIGHT_NO_ROW, block == LIGHT_NO_ROW);
        atomicStore(&light_marks[light_cuts.grid.records + rows.x + rows.y + row], link);
    }
    return row;
}

// Records whether a sample's point on a light is visible: whether a shadow ray to it met nothing. For a
// segment `chosen` is the last sample that was drawn. Nothing is recorded for directional lights, for lights that
// are gone, and for samples whose pmf is 0. It takes effect when the frame is folded. Twin of
// `LightSampler::record_visibility`.
fn light_record_visibility(shading_point: LightShadingPoint, chosen: LightSample, is_visible: bool) {
    let index = light_find(chosen.instance, chosen.light);
    let rows = light_row_counts();
    if chosen.pmf <= 0.0 || rows.x == 0u || index == LIGHT_NO_LIGHT {
        return;
    }
    let cell = light_cell(shading_point);
    let row = light_row_to_record(cell);
    if row == LIGHT_NO_ROW {
        return;
    }
    let counts = 2u * (rows.x + rows.y + row * LIGHT_BINS) + select(0u, 1u, is_visible);
    var instance = chosen.instance;
    var base = light_node_base(instance);
    var local = light_local_to_tree(instance, shading_point);
    var place = light_place(index);
    // The light was removed.
    if place == LIGHT_NO_PARENT {
        return;
    }
    var last = light_bin(light_toward_sample(shading_point, chosen) + cell.from_center);
    atomicAdd(&light_marks[light_cuts.grid.records + counts + 2u * last], 1u);
    loop {
        if instance != LIGHT_NO_INSTANCE && light_leaves_tree(place) {
            place = light_place_above(instance, place);
            instance = LIGHT_NO_INSTANCE;
            base = 0u;
            local = light_local_to_top(shading_point);
        }
        if instance == LIGHT_NO_INSTANCE && place == LIGHT_NO_PARENT {
            break;
        }
        let in_top = instance == LIGHT_NO_INSTANCE;
        let index = base + place / LIGHT_WIDTH;
        let at = index * LIGHT_NODE_QUADS;
        let view = light_node_view(light_quad(in_top, at), local);
        let bin = light_child_bin(
            light_packed_child(in_top, at, place % LIGHT_WIDTH), view, instance, local, cell.from_center,
        );
        if bin != last {
            atomicAdd(&light_marks[light_cuts.grid.records + counts + 2u * bin], 1u);
        }
        last = bin;
        place = light_parent(in_top, index);
    }
}

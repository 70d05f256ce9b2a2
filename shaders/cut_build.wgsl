// Builds the cuts of listed cells: a workgroup for each cell, with an invocation for each of its points
// and each child of a node. Twin of src/sampling/cuts/build.rs, which explains it.

// As in cut_list.wgsl.
const TO_BUILD: u32 = 5u;
// The last point is the middle of the cell.
const CENTER: u32 = LIGHT_CELL_POINTS;
const STOP: u32 = 0xffffffffu;
// In place of the child that the sky's root would be.
const SECOND_ROOT: u32 = 0xfffffffeu;

// For each node and invocation the importance, and in the end the share of all light.
var<workgroup> importance: array<f32, 2048>;
// For each child of each node what it is split by; 0 for what cannot be split.
var<workgroup> keys: array<u32, 256>;
var<workgroup> nodes: array<LightPlace, 32>;
// The child that each node was, and a word with the fluxes of four children for each invocation.
var<workgroup> parents: array<u32, 32>;
var<workgroup> fluxes: array<u32, 64>;
// Bits of the children that may send light.
var<workgroup> lit: array<u32, 32>;
// How much the points disagree about the children of each node.
var<workgroup> disagreements: array<f32, 32>;
// A byte for each contested node, and the bits of its children that are candidates.
var<workgroup> contested: array<vec2<u32>, LIGHT_CONTESTED>;
var<workgroup> exchanged: array<vec4<f32>, 64>;
var<workgroup> greatest: atomic<u32>;
// The next node, and the child that it is; or STOP.
var<workgroup> next: vec3<u32>;
var<workgroup> job: u32;
// What weights by points and by the middle are multiplied by, what is added to all, and what directional
// lights bring over what trees do.
var<workgroup> parts: vec4<f32>;
// What candidates bring that are not contested, in lux; 1 if none is.
var<workgroup> rest_lux: f32;

// Twin of `unscrambled`.
fn cell_unscrambled(scrambled: u32) -> u32 {
    var word = (scrambled ^ (scrambled >> 16u)) * 0x43021123u;
    word = (word ^ (word >> 15u) ^ (word >> 30u)) * 0x1d69e2a5u;
    return word ^ (word >> 16u);
}

// Twin of `normal_of`.
fn cell_normal(normal_class: u32, slopes: u32) -> vec3<f32> {
    if normal_class >= LIGHT_VOLUME_CLASS {
        return vec3(0.0);
    }
    let within = vec2<f32>((vec2(slopes >> LIGHT_SLOPE_BITS, slopes) & vec2((1u << LIGHT_SLOPE_BITS) - 1u)));
    let classes = vec2<f32>(vec2(normal_class / 3u, normal_class) % vec2(3u));
    let slope = ((classes - 1.0) + (within - LIGHT_SLOPE_ZERO) / LIGHT_SLOPE_STEPS) / LIGHT_SLOPE_CLASSES;
    let largest = select(1.0, -1.0, (normal_class / 9u) % 2u == 1u);
    let axis = normal_class / 18u;
    var normal = vec3(largest, slope);
    if axis == 1u {
        normal = vec3(slope.y, largest, slope.x);
    } else if axis == 2u {
        normal = vec3(slope, largest);
    }
    return normalize(normal);
}

// A point of a cell, or its middle. Twin of `CutGrid::point` and `CutGrid::center`.
fn cell_point(cell: LightCutCell, kept: u32, is_center: bool) -> LightShadingPoint {
    let word = cell_unscrambled(kept) >> LIGHT_RANDOM_BITS;
    let shifts = 2u * LIGHT_SLOPE_BITS + LIGHT_PLACE_BITS * vec3(2u, 1u, 0u);
    let within = vec3<f32>((vec3(word) >> shifts) & vec3((1u << LIGHT_PLACE_BITS) - 1u)) + 0.5;
    let place = select(within, vec3(f32(1u << (LIGHT_PLACE_BITS - 1u))), is_center);
    let position = row_position(cell, place);
    var point: LightShadingPoint;
    if is_center {
        point = light_volume_point(position);
    } else {
        let normal = cell_normal((cell.kind >> 4u) & 63u, word);
        let gloss = cell.kind >> LIGHT_GLOSS_SHIFT;
        point = light_surface_point(position, normal);
        // #if GLOSSY
        if gloss != 0u {
            let ratio = exp2(f32(gloss >> 8u) + LIGHT_LEAST_RATIO);
            let roughness = f32((gloss & 255u) - 1u) / LIGHT_ROUGHNESS_STEPS;
            point = light_glossy_point(
                position, normal, light_cuts.grid.eye - position, roughness, ratio / (1.0 + ratio), 1.0 / (1.0 + ratio),
            );
        }
        // #endif
    }
    return light_masked_point(point, cell.mask);
}

// What a child of a node sends to a point, and whether any of its lights may reach the cell, by its mask.
struct Estimate {
    lux: f32,
    doubt: f32,
    is_lit: bool,
    is_light: bool,
}

fn estimate(
    place: LightPlace, slot: u32, point: LightShadingPoint, mask: u32, local: LightLocalShadingPoint,
    // #if LEARNS
    learnt: LightCell,
    // #endif
    is_center: bool,
) -> Estimate {
    let in_top = place.instance == LIGHT_NO_INSTANCE;
    let at = place.index * LIGHT_NODE_QUADS;
    let packed = light_packed_child(in_top, at, slot);
    let is_light = (packed.child_bits & local.light_bit) != 0u;
    // Where all instances have all bits, the text knows no masks, and a cell without a bit sees none of them.
    var is_lit = light_has_flux(packed) && mask != 0u;
    // #if MASKS
    is_lit = is_lit && (light_met_children(in_top, place.index, mask) & (1u << slot)) != 0u;
    // #endif
    if !is_lit {
        return Estimate(0.0, 0.0, false, is_light);
    }
    let view = light_node_view(light_quad(in_top, at), local);
    var found = light_importance(packed, local, view);
    // #if LEARNS
    found.lux *= light_child_share(packed, view, place.instance, local, learnt);
    // #endif
    // #if MASKS
    found.lux *= light_seen_share(in_top, packed.child_bits, mask);
    // #endif
    // #if SKY
    // #if PORTALS
    // The middle stands for all points of the cell, which may see other parts of the sky.
    let portals = select(light_portals_in_sight(place, point), 0u, is_center);
    if portals != 0u {
        let share = light_portal_share(portals, light_quad(in_top, at), packed, point);
        found.lux *= share;
        found.doubt += select(1.0 - share, 0.0, is_light);
    }
    // #endif
    // #endif
    return Estimate(found.lux, found.doubt, true, is_light);
}

// What a child is split by: of its doubts and shares at all points the mean doubt, and the deviation of
// the shares. `sums` are those of doubts, shares and squared shares.
fn priority(sums: vec3<f32>, count: u32) -> f32 {
    let mean = sums / f32(count);
    return mean.x + LIGHT_DEVIATION * sqrt(max(mean.z - mean.y * mean.y, 0.0));
}

@compute @workgroup_size(64)
fn cut_build(
    @builtin(local_invocation_index) lane: u32, @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let number = group.x + group.y * groups.x;
    if lane == 0u {
        let slot = atomicLoad(&light_marks[light_cuts.grid.listed + number]);
        job = select(0u, LIGHT_CUT_HEAD + LIGHT_SLOT_WORDS * slot, number < atomicLoad(&light_marks[TO_BUILD]));
    }
    let slot_at = workgroupUniformLoad(&job);
    if slot_at == 0u {
        return;
    }
    let cell = row_cell(slot_at);
    let view = lane / LIGHT_WIDTH;
    let slot = lane % LIGHT_WIDTH;
    let first_of_view = view * LIGHT_WIDTH;
    var point_count = 0u;
    for (var i = 0u; i < LIGHT_CELL_POINTS; i++) {
        point_count += select(0u, 1u, atomicLoad(&light_marks[slot_at + 9u + i]) != 0u);
    }
    var word = 0u;
    if view < CENTER {
        word = atomicLoad(&light_marks[slot_at + 9u + view]);
    }
    let is_center = view == CENTER;
    let is_view = is_center || word != 0u;
    let point = cell_point(cell, word, is_center);
    var directional = 0.0;
    // #if DIRECTIONAL
    directional = select(0.0, light_directional_lux(point), is_view);
    // #endif

    // #if LEARNS
    var learnt = light_cell(point);
    if is_center {
        learnt.row = LIGHT_NO_ROW;
    }
    // #endif

    // Split until no split is worth its time, or as often as there is room.
    var place = LightPlace(LIGHT_NO_INSTANCE, 0u);
    var local = light_local_to_top(point);
    var count = 0u;
    if lane == 0u {
        next = vec3(0u);
    }
    // The sum of the resolved importances of this invocation.
    var column = 0.0;
    loop {
        let found = estimate(
            place, slot, point, cell.mask, local,
            // #if LEARNS
            learnt,
            // #endif
            is_center,
        );
        let lux = select(0.0, found.lux, is_view);
        importance[count * 64u + lane] = lux;
        column += max(lux, 0.0);
        exchanged[lane].x = column;
        workgroupBarrier();
        var total = directional;
        for (var i = 0u; i < LIGHT_WIDTH; i++) {
            total += exchanged[first_of_view + i].x;
        }
        let share = select(0.0, max(lux, 0.0) / total, total > 0.0);
        let doubt = select(share * found.doubt, LIGHT_UNRESOLVED_DOUBT, lux < 0.0);
        workgroupBarrier();
        exchanged[lane] = vec4(doubt, share, share * share, select(0.0, 1.0, found.is_lit));
        workgroupBarrier();
        if view == 0u {
            var sums = vec3(0.0);
            for (var i = 0u; i < CENTER; i++) {
                sums += exchanged[i * LIGHT_WIDTH + slot].xyz;
            }
            let id = count * LIGHT_WIDTH + slot;
            let key = (bitcast<u32>(priority(sums, point_count)) & ~LIGHT_SHARED_BITS) | (LIGHT_SHARED_BITS - id);
            keys[id] = select(key, 0u, found.is_light);
        }
        if lane == 0u {
            nodes[count] = place;
            parents[count] = select(next.z, LIGHT_SKY_ROOT, next.z == SECOND_ROOT);
            var bits = 0u;
            for (var i = 0u; i < LIGHT_WIDTH; i++) {
                bits |= select(0u, 1u << i, exchanged[i].w > 0.0);
            }
            lit[count] = bits;
            atomicStore(&greatest, 0u);
        }
        workgroupBarrier();
        count++;
        if count == LIGHT_SHARED_NODES {
            break;
        }
        var best = 0u;
        for (var id = lane; id < count * LIGHT_WIDTH; id += 64u) {
            best = max(best, keys[id]);
        }
        atomicMax(&greatest, best);
        workgroupBarrier();
        if lane == 0u {
            let key = atomicLoad(&greatest);
            let id = LIGHT_SHARED_BITS - (key & LIGHT_SHARED_BITS);
            var is_sky = false;
            // #if SKY
            is_sky = count == 1u && light_sees_sky(point);
            // #endif
            if is_sky {
                // #if SKY
                let root = light_sky_root();
                next = vec3(root.instance, root.index, SECOND_ROOT);
                // #endif
            } else if bitcast<f32>(key & ~LIGHT_SHARED_BITS) <= LIGHT_MIN_SHARED_DOUBT {
                next.z = STOP;
            } else {
                let below = light_child_place(nodes[id / LIGHT_WIDTH], id % LIGHT_WIDTH);
                next = vec3(below.instance, below.index, id);
                lit[id / LIGHT_WIDTH] &= ~(1u << (id % LIGHT_WIDTH));
                keys[id] = 0u;
            }
        }
        let chosen = workgroupUniformLoad(&next);
        if chosen.z == STOP {
            break;
        }
        // The candidate's own children replace it.
        if chosen.z != SECOND_ROOT && slot == chosen.z % LIGHT_WIDTH {
            importance[(chosen.z / LIGHT_WIDTH) * 64u + lane] = 0.0;
            column = 0.0;
            for (var node = 0u; node < count; node++) {
                column += max(importance[node * 64u + lane], 0.0);
            }
        }
        if chosen.x != place.instance {
            local = light_local_to(chosen.x, point);
        }
        place = LightPlace(chosen.x, chosen.y);
    }

    // Turn importances into shares of all light at each point, in which unresolved candidates have at
    // most as much as all others.
    var doubtful = 0.0;
    for (var node = 0u; node < count; node++) {
        doubtful += max(-importance[node * 64u + lane], 0.0);
    }
    exchanged[lane] = vec4(column, doubtful, 0.0, 0.0);
    workgroupBarrier();
    var sums = vec2(directional, 0.0);
    for (var i = 0u; i < LIGHT_WIDTH; i++) {
        sums += exchanged[first_of_view + i].xy;
    }
    let scale = light_unresolved_scale(sums.x, sums.y);
    let all = sums.x + sums.y * scale;
    let inverse = select(0.0, 1.0 / all, all > 0.0);
    for (var node = 0u; node < count; node++) {
        let lux = importance[node * 64u + lane];
        let weight = select(lux, max(-lux * scale, LIGHT_MIN_IMPORTANCE), lux < 0.0);
        importance[node * 64u + lane] = weight * inverse;
    }
    workgroupBarrier();
    let sun = directional * inverse;
    let squares_of_sun = select(0.0, sun * sun, view < CENTER && slot == 0u);

    // Each invocation has four children. Their weights are the roots of mean squared shares.
    let node = lane / 2u;
    let first_slot = 4u * (lane % 2u);
    var weights = vec4(0.0);
    var center = vec4(0.0);
    var is_lit = vec4(0u);
    var disagreement = 0.0;
    if node < count {
        for (var i = 0u; i < 4u; i++) {
            let at = node * 64u + first_slot + i;
            var sum = 0.0;
            var squares = 0.0;
            for (var k = 0u; k < CENTER; k++) {
                sum += importance[at + k * LIGHT_WIDTH];
                squares += importance[at + k * LIGHT_WIDTH] * importance[at + k * LIGHT_WIDTH];
            }
            weights[i] = sqrt(squares / f32(point_count));
            disagreement += max(weights[i] - sum / f32(point_count), 0.0);
            center[i] = importance[at + CENTER * LIGHT_WIDTH];
            is_lit[i] = (lit[node] >> (first_slot + i)) & 1u;
        }
    }
    exchanged[lane] = vec4(
        disagreement, (weights.x + weights.y) + (weights.z + weights.w), squares_of_sun,
        select(0.0, all / f32(point_count), view < CENTER && slot == 0u),
    );
    workgroupBarrier();
    // For lane 0: all weights, and the sums of what directional lights bring, squared, and of all light at the points.
    var whole = vec3(0.0);
    if lane == 0u {
        for (var i = 0u; i < 64u; i++) {
            whole += exchanged[i].yzw;
        }
    }
    // The nodes about whose children the points disagree most are contested.
    if lane < LIGHT_SHARED_NODES {
        disagreements[lane] = exchanged[2u * lane].x + exchanged[2u * lane + 1u].x;
        let name = LIGHT_SHARED_NODES - 1u;
        keys[lane] = (bitcast<u32>(disagreements[lane]) & ~name) | (name - lane);
    }
    if lane < LIGHT_CONTESTED {
        contested[lane] = vec2(0u);
    }
    workgroupBarrier();
    if lane < count {
        var rank = 0u;
        var others = 0.0;
        for (var i = 0u; i < count; i++) {
            let is_less = keys[i] <= keys[lane];
            rank += select(1u, 0u, is_less);
            others += select(0.0, disagreements[i], is_less);
        }
        if rank < LIGHT_CONTESTED && others >= LIGHT_DISAGREEMENT {
            contested[rank] = vec2(lane, lit[lane]);
        }
    }
    workgroupBarrier();
    var contested_bits = 0u;
    var named = vec2(0u);
    for (var k = 0u; k < LIGHT_CONTESTED; k++) {
        contested_bits |= select(0u, 1u << contested[k].x, contested[k].y != 0u);
        named |= contested[k] << vec2(8u * k);
    }
    if ((contested_bits >> node) & 1u) != 0u {
        weights = vec4(0.0);
        center = vec4(0.0);
        is_lit = vec4(0u);
    }
    var rest = 0.0;
    for (var i = 0u; i < count; i++) {
        rest += select(importance[i * 64u + lane], 0.0, ((contested_bits >> i) & 1u) != 0u);
    }
    let lit_lanes = vec4<f32>(is_lit);
    exchanged[lane] = vec4(
        (weights.x + weights.y) + (weights.z + weights.w), (center.x + center.y) + (center.z + center.w),
        (lit_lanes.x + lit_lanes.y) + (lit_lanes.z + lit_lanes.w), rest * (all / f32(point_count)),
    );
    workgroupBarrier();
    if lane == 0u {
        var sums_of_lanes = vec4(0.0);
        for (var i = 0u; i < 64u; i++) {
            sums_of_lanes += vec4(exchanged[i].xyz, select(0.0, exchanged[i].w, i < CENTER * LIGHT_WIDTH));
        }
        let sun_lux = sqrt(whole.y / f32(point_count));
        let sun_part = clamp(sun_lux / (sun_lux + whole.x), LIGHT_MIN_SIDE, 1.0 - LIGHT_MIN_SIDE);
        let has_sun = light_params.directional_count != 0u;
        let has_light = (contested_bits != 0u || sums_of_lanes.z > 0.0) && whole.x + sun_lux > 0.0;
        rest_lux = select(0.0, max(sums_of_lanes.w, LIGHT_MIN_SIDE * whole.z), sums_of_lanes.z > 0.0);
        rest_lux = select(rest_lux, 1.0, contested_bits == 0u);
        parts = select(
            vec4(0.0),
            vec4(
                select(0.0, (1.0 - LIGHT_EVEN - LIGHT_CENTER) / sums_of_lanes.x, sums_of_lanes.x > 0.0),
                select(0.0, LIGHT_CENTER / sums_of_lanes.y, sums_of_lanes.y > 0.0),
                LIGHT_EVEN / max(sums_of_lanes.z, 1.0), select(0.0, sun_part / (1.0 - sun_part), has_sun),
            ),
            has_light,
        );
    }
    let shared_parts = workgroupUniformLoad(&parts);

    // Each has a unit, and no more than all units are handed out.
    let part = weights * shared_parts.x + center * shared_parts.y + shared_parts.z;
    let units = select(vec4(0u), vec4<u32>(min(part, vec4(1.0)) * f32(LIGHT_SHARED_UNITS - 512u)) + 1u, is_lit != vec4(0u));
    keys[lane] = (units.x + units.y) + (units.z + units.w);
    workgroupBarrier();
    var before = 0u;
    for (var i = 0u; i < lane; i++) {
        before += keys[i];
    }
    let row = row_quad(atomicLoad(&light_marks[slot_at + 2u]));
    let running = vec4(units.x, units.x + units.y, units.x + units.y + units.z, 0u);
    let sum_at_end = before + running.z + units.w;
    light_cuts.quads[row + LIGHT_ROW_SUMS + lane] = vec4(before + running.xyz, sum_at_end);
    if lane % 4u == 3u {
        let block = lane / 4u;
        light_cuts.quads[row + 1u + block / 4u][block % 4u] = sum_at_end;
    }
    if lane < LIGHT_SHARED_NODES / 2u {
        var pair = vec4(0xffffffffu);
        if 2u * lane < count {
            pair = vec4(nodes[2u * lane].instance, nodes[2u * lane].index, pair.zw);
        }
        if 2u * lane + 1u < count {
            pair = vec4(pair.xy, nodes[2u * lane + 1u].instance, nodes[2u * lane + 1u].index);
        }
        light_cuts.quads[row + LIGHT_ROW_NODES + lane] = pair;
    }
    // What tells later whether the row still suits.
    workgroupBarrier();
    keys[lane] = 0u;
    fluxes[lane] = 0u;
    if node < count {
        let known = row_children(nodes[node], first_slot, cell.mask);
        keys[lane] = known.name;
        fluxes[lane] = known.flux;
    }
    workgroupBarrier();
    if lane < LIGHT_SHARED_NODES / 2u {
        let first = 4u * lane;
        light_cuts.quads[row + LIGHT_ROW_FLUX + lane] =
            vec4(fluxes[first], fluxes[first + 1u], fluxes[first + 2u], fluxes[first + 3u]);
    }
    if lane < LIGHT_SHARED_NODES / 16u {
        var words = vec4(0u);
        for (var i = 0u; i < 16u; i++) {
            let index = 16u * lane + i;
            words[i / 4u] |= select(0u, parents[index], index < count) << (8u * (i % 4u));
        }
        light_cuts.quads[row + LIGHT_ROW_FROM + lane] = words;
    }
    if lane == 62u {
        var name = 0u;
        for (var i = 0u; i < 64u; i++) {
            name += keys[i];
        }
        let age = light_cuts.quads[row + LIGHT_ROW_STATE].y;
        // Read again, so that no register holds it while nodes are split.
        let same_cell = row_cell(slot_at);
        let toward = row_direction(row_toward(same_cell, row_center(same_cell)));
        light_cuts.quads[row + LIGHT_ROW_STATE] = vec4(name, age, toward, row_sky());
    }
    if lane == 63u {
        light_cuts.quads[row] =
            vec4(count | (point_count << 16u), bitcast<u32>(rest_lux), bitcast<u32>(shared_parts.w), sum_at_end);
        if shared_parts.z > 0.0 {
            atomicStore(&light_marks[slot_at + 3u], point_count);
            let slot = (slot_at - LIGHT_CUT_HEAD) / LIGHT_SLOT_WORDS;
            light_cuts.quads[1u + slot] = vec4(atomicLoad(&light_marks[slot_at]), row, named);
        }
        for (var i = 0u; i < LIGHT_CELL_POINTS; i++) {
            atomicStore(&light_marks[slot_at + 9u + i], 0u);
        }
    }
}

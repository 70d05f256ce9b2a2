// Splits the clusters near the shading point, so that one light is chosen among all candidates that
// are left. Twin of src/sampling/cut.rs, which explains it. Reads the buffers that sample.wgsl
// binds.
//
// A GPU has no room for the importances of all candidates, so a cut keeps one sum for each node that
// was split, and a walk weighs the children of the node that it chooses once more. Of the children
// that may be split next it keeps as many as there are splits. No array is indexed at run time,
// because such arrays are in memory.

// The nodes that a cut has at most: the root and one node for each split.
const LIGHT_CUT_NODES: u32 = LIGHT_MAX_SPLITS + 1u;

// The candidates of a shading point: the children of the nodes that were split.
struct LightCut {
    // The number of nodes that were split.
    node_count: u32,
    // The index of each of them, with LIGHT_LEAF for nodes of the top level.
    first_nodes: vec4<u32>,
    last_nodes: vec4<u32>,
    // For each of them but the root: which child of which of them it is. Six bits each. The highest bit
    // of the first word is set if the first split is not counted.
    links: vec2<u32>,
    // For each of them the sum of its children's weights, without unresolved children until the last
    // split.
    sums: LightLanes,
    // A bit for each node with unresolved candidates.
    unresolved_nodes: u32,
    pending: LightPending,
    // The sum of all weights: the estimated illuminance by all candidates, in lux.
    total: f32,
    // The sum of the importances of unresolved candidates; after the last split what each of them is
    // multiplied by.
    unresolved: f32,
}

// The children that may be split next, the one with the greatest doubt first. They are not in the
// sums of their nodes. The eighth place is always empty.
struct LightPending {
    // Importance times relative doubt, as the bits of a float. The last six bits name the child, so
    // that of equal doubts the first child has the greatest key.
    first_keys: vec4<u32>,
    last_keys: vec4<u32>,
    // The importances.
    first_lux: vec4<f32>,
    last_lux: vec4<f32>,
}

const LIGHT_CHILD_BITS: u32 = 63u;

// The child in a slot of a node of the cut, as a number.
fn light_child_id(node: u32, slot: u32) -> u32 {
    return node * LIGHT_WIDTH + slot;
}

// The bits of a doubt that a key has.
fn light_doubt_bits(doubt: f32) -> u32 {
    return bitcast<u32>(doubt) & ~LIGHT_CHILD_BITS;
}

fn light_id_of_key(key: u32) -> u32 {
    return LIGHT_CHILD_BITS - (key & LIGHT_CHILD_BITS);
}

// Which child of which node of the cut a node is, the root excepted.
fn light_link(links: vec2<u32>, node: u32) -> u32 {
    return extractBits(select(links.x, links.y, node > 4u), 6u * ((node - 1u) & 3u), 6u);
}

// A node of the cut: goes down from the root by the links.
fn light_cut_place(links: vec2<u32>, number: u32) -> LightPlace {
    var slots = 0u;
    var depth = 0u;
    // #if SKY
    var is_below_sky = false;
    // #endif
    for (var node = number; node != 0u; node = light_link(links, node) / LIGHT_WIDTH) {
        // #if SKY
        if light_link(links, node) == LIGHT_SKY_LINK {
            is_below_sky = true;
            break;
        }
        // #endif
        slots = (slots << 3u) | (light_link(links, node) % LIGHT_WIDTH);
        depth++;
    }
    var place = LightPlace(LIGHT_NO_INSTANCE, 0u);
    // #if SKY
    if is_below_sky {
        place = light_sky_root();
    }
    // #endif
    for (; depth != 0u; depth--) {
        place = light_child_place(place, slots % LIGHT_WIDTH);
        slots >>= 3u;
    }
    return place;
}

// A bit for each child of a node of the cut that was split itself.
fn light_split_children(cut: ptr<function, LightCut>, number: u32) -> u32 {
    var split = 0u;
    for (var node = 1u; node < (*cut).node_count; node++) {
        let id = light_link((*cut).links, node);
        // #if SKY
        if id == LIGHT_SKY_LINK {
            continue;
        }
        // #endif
        split |= select(0u, 1u << (id % LIGHT_WIDTH), id / LIGHT_WIDTH == number);
    }
    return split;
}

// Adds a candidate to the sum of its node.
fn light_add_to_sum(cut: ptr<function, LightCut>, node: u32, lux: f32) {
    if lux < 0.0 {
        (*cut).unresolved -= lux;
        (*cut).unresolved_nodes |= 1u << node;
        return;
    }
    (*cut).sums.first += select(vec4(0.0), vec4(lux), vec4(node) == vec4(0u, 1u, 2u, 3u));
    (*cut).sums.last += select(vec4(0.0), vec4(lux), vec4(node) == vec4(4u, 5u, 6u, 7u));
}

// Makes a child a candidate: puts it in its place among the pending ones. The last of these is not
// split any more if all have a place before it; nor is a child whose doubt is too small for a key.
fn light_add_candidate(cut: ptr<function, LightCut>, doubt: f32, id: u32, lux: f32) {
    var pending = (*cut).pending;
    var added_id = id;
    var added_lux = lux;
    if light_doubt_bits(doubt) != 0u {
        let key = light_doubt_bits(doubt) | (LIGHT_CHILD_BITS - id);
        let keys = pending.first_keys;
        let last_keys = pending.last_keys;
        let all_lux = pending.first_lux;
        let last_lux = pending.last_lux;
        // The places from the first lower key on move back by one.
        let moves = vec4(key) > keys;
        let last_moves = vec4(key) > last_keys;
        let follows = vec4(false, moves.xyz);
        let last_follows = vec4(moves.w, last_moves.xyz);
        pending.first_keys = select(keys, select(vec4(key), vec4(key, keys.xyz), follows), moves);
        pending.last_keys = select(last_keys, select(vec4(key), vec4(keys.w, last_keys.xyz), last_follows), last_moves);
        pending.first_lux = select(all_lux, select(vec4(lux), vec4(lux, all_lux.xyz), follows), moves);
        pending.last_lux = select(last_lux, select(vec4(lux), vec4(all_lux.w, last_lux.xyz), last_follows), last_moves);
        added_id = light_id_of_key(pending.last_keys.w);
        added_lux = pending.last_lux.w;
        pending.last_keys.w = 0u;
        pending.last_lux.w = 0.0;
        (*cut).pending = pending;
    }
    light_add_to_sum(cut, added_id / LIGHT_WIDTH, added_lux);
}

// Takes the first pending child out.
fn light_shift_pending(cut: ptr<function, LightCut>) {
    let pending = (*cut).pending;
    (*cut).pending = LightPending(
        vec4(pending.first_keys.yzw, pending.last_keys.x), vec4(pending.last_keys.yzw, 0u),
        vec4(pending.first_lux.yzw, pending.last_lux.x), vec4(pending.last_lux.yzw, 0.0),
    );
}

// Weighs the children of a node. `local` is the shading point in the node's space.
fn light_weigh(
    cut: ptr<function, LightCut>, place: LightPlace, shading_point: LightShadingPoint,
    local: LightLocalShadingPoint, is_split: bool, skipped: u32,
) -> LightLanes {
    let in_top = place.instance == LIGHT_NO_INSTANCE;
    let at = place.index * light_params.node_stride;
    let view = light_node_view(light_quad(in_top, at), local);
    var left_out = skipped;
    // #if MASKS
    left_out |= ~light_met_children(in_top, place.index, shading_point.mask);
    // #endif
    // #if COUNTS
    light_nodes_read++;
    // #endif
    // #if SKY
    // #if PORTALS
    let portals = light_portals_in_sight(place, shading_point);
    // #endif
    // #endif
    var lanes = LightLanes(vec4(0.0), vec4(0.0));
    // #if SEGMENTS
    // A loop for each kind of estimate, so that an adapter that runs both sides of a branch runs one
    // of them once and not eight times.
    if local.segment.w > 0.0 {
        for (var slot = 0u; slot < LIGHT_WIDTH; slot++) {
            let packed = light_packed_child(in_top, at, slot);
            if light_has_flux(packed) && (left_out & (1u << slot)) == 0u {
                var estimate = light_importance_along(packed, local, view);
                // #if MASKS
                estimate.lux *= light_seen_share(in_top, packed.child_bits, shading_point.mask);
                // #endif
                light_take(cut, &lanes, slot, packed, local, is_split, estimate);
            }
        }
        return lanes;
    }
    // #endif
    for (var slot = 0u; slot < LIGHT_WIDTH; slot++) {
        let packed = light_packed_child(in_top, at, slot);
        if light_has_flux(packed) && (left_out & (1u << slot)) == 0u {
            var estimate = light_importance(packed, local, view);
            // #if MASKS
            estimate.lux *= light_seen_share(in_top, packed.child_bits, shading_point.mask);
            // #endif
            // #if SKY
            // #if PORTALS
            if portals != 0u {
                let share = light_portal_share(portals, light_quad(in_top, at), packed, shading_point);
                estimate.lux *= share;
                estimate.doubt += select(1.0 - share, 0.0, (packed.child_bits & local.light_bit) != 0u);
            }
            // #endif
            // #endif
            light_take(cut, &lanes, slot, packed, local, is_split, estimate);
        }
    }
    return lanes;
}

// Takes the estimate of a child: makes it a candidate, or sets its lane.
fn light_take(
    cut: ptr<function, LightCut>, lanes: ptr<function, LightLanes>, slot: u32, packed: LightPackedChild,
    local: LightLocalShadingPoint, is_split: bool, estimate: LightImportance,
) {
    let lux = estimate.lux;
    if is_split {
        if lux != 0.0 {
            // What cannot be resolved is split first, but single lights cannot be split.
            let is_light = (packed.child_bits & local.light_bit) != 0u;
            let unresolved_doubt = select(-lux * LIGHT_UNRESOLVED_DOUBT, 0.0, is_light);
            let doubt = select(lux * estimate.doubt, unresolved_doubt, lux < 0.0);
            light_add_candidate(cut, doubt, light_child_id((*cut).node_count, slot), lux);
        }
        return;
    }
    light_set_lane(lanes, slot, lux);
}

// Splits the pending child with the greatest doubt, if that is worth its time and allowed. Returns
// whether it did; the links of the cut then lead to the child as its last node. Otherwise all
// pending children have been added to the sums of their nodes.
fn light_split_next(cut: ptr<function, LightCut>) -> bool {
    (*cut).node_count++;
    let count = (*cut).node_count;
    // One huge unresolved importance would make the doubts about all others look small.
    let total = light_sum((*cut).sums)
        + light_resolved_sum(LightLanes((*cut).pending.first_lux, (*cut).pending.last_lux));
    let keys = (*cut).pending.first_keys.xy;
    let is_worth = bitcast<vec2<f32>>(keys & vec2(~LIGHT_CHILD_BITS)) > vec2(LIGHT_MIN_DOUBT * total);
    // A split that has no alternative is not counted.
    if count == 1u && light_splits != 0u && !is_worth.y {
        (*cut).links.x = 0x80000000u;
    }
    if is_worth.x && count <= min(light_splits + ((*cut).links.x >> 31u), LIGHT_MAX_SPLITS) {
        let link = light_id_of_key(keys.x) << (6u * ((count - 1u) & 3u));
        (*cut).links |= select(vec2(link, 0u), vec2(0u, link), count > 4u);
        light_shift_pending(cut);
        return true;
    }
    while (*cut).pending.first_keys.x != 0u {
        light_add_to_sum(cut, light_id_of_key((*cut).pending.first_keys.x) / LIGHT_WIDTH, (*cut).pending.first_lux.x);
        light_shift_pending(cut);
    }
    (*cut).total = light_sum((*cut).sums);
    return false;
}

// Splits the root of the top level and then, up to light_splits times, the candidate with the
// greatest doubt. If only one child of the root is worth a split, that one is not counted. Limits the
// weights of all unresolved candidates together, relative to the other candidates and the directional
// lights. Twin of `Cut::new`.
fn light_new_cut(cut: ptr<function, LightCut>, directional_lux: f32, shading_point: LightShadingPoint) {
    // Some drivers need a read before the loop: see the test
    // `a_shader_may_choose_lights_where_some_invocations_have_returned`.
    if light_params.slots == 0u {
        return;
    }
    var local: LightLocalShadingPoint;
    var local_instance = LIGHT_NO_INSTANCE;
    var node = 0u;
    var skipped = 0u;
    var is_split = true;
    loop {
        let place = light_cut_place((*cut).links, node);
        if node == 0u || place.instance != local_instance {
            local = light_local_to(place.instance, shading_point);
            local_instance = place.instance;
        }
        let lanes = light_weigh(cut, place, shading_point, local, is_split, skipped);
        if is_split {
            light_name_node(cut, node, place);
            // #if SKY
            if node == 0u && light_sees_sky(shading_point) {
                // The next node, which is not counted as a split.
                (*cut).links.x = 0x80000000u | LIGHT_SKY_LINK;
                (*cut).node_count = 1u;
                node = 1u;
                continue;
            }
            // #endif
            if light_split_next(cut) {
                node = (*cut).node_count;
                continue;
            }
            (*cut).unresolved = light_unresolved_scale((*cut).total + directional_lux, (*cut).unresolved);
            is_split = false;
        } else {
            // The children of a node with unresolved candidates have been weighed once more.
            var sums = (*cut).sums;
            light_set_lane(&sums, node, light_sum(light_scale_unresolved(lanes, (*cut).unresolved)));
            (*cut).sums = sums;
            (*cut).total = light_sum(sums);
            (*cut).unresolved_nodes &= ~(1u << node);
        }
        if (*cut).unresolved_nodes == 0u {
            break;
        }
        node = firstTrailingBit((*cut).unresolved_nodes);
        skipped = light_split_children(cut, node);
    }
}

// Records which node a node of the cut is.
fn light_name_node(cut: ptr<function, LightCut>, node: u32, place: LightPlace) {
    let id = light_node_id(place);
    (*cut).first_nodes = select((*cut).first_nodes, vec4(id), vec4(node) == vec4(0u, 1u, 2u, 3u));
    (*cut).last_nodes = select((*cut).last_nodes, vec4(id), vec4(node) == vec4(4u, 5u, 6u, 7u));
}

fn light_node_id(place: LightPlace) -> u32 {
    return place.index | select(0u, LIGHT_LEAF, place.instance == LIGHT_NO_INSTANCE);
}

// The number of a node among those of the cut; LIGHT_CUT_NODES if it is not one.
fn light_number_in_cut(cut: ptr<function, LightCut>, place: LightPlace) -> u32 {
    let id = vec4(light_node_id(place));
    let first = select(vec4(0u), vec4(1u, 2u, 4u, 8u), (*cut).first_nodes == id);
    let last = select(vec4(0u), vec4(16u, 32u, 64u, 128u), (*cut).last_nodes == id);
    let found = first | last;
    // Several instances may have the same nodes.
    var numbers = (found.x | found.y | found.z | found.w) & ((1u << (*cut).node_count) - 1u);
    while numbers != 0u {
        let number = firstTrailingBit(numbers);
        if light_cut_place((*cut).links, number).instance == place.instance {
            return number;
        }
        numbers &= numbers - 1u;
    }
    return LIGHT_CUT_NODES;
}

// Chooses lights by the cut of a cell and by rough estimates below it; from the roots where the cell has no cut.
// Twin of src/sampling/walk.rs with src/sampling/cuts/placed.rs and src/sampling/roots.rs. Reads the buffers that sample.wgsl binds.

// What a point chooses from.
struct LightCut {
    // The row of its cell, as in light_shared_cut; 0 for the roots of the trees.
    row: u32,
    // What all trees bring, on the scale of the illuminance by directional lights.
    total: f32,
    // Without a row: LIGHT_ROOT_OF_TOP if the top level has lights, and LIGHT_ROOT_OF_SKY if the point sees the sky.
    roots: u32,
}

const LIGHT_ROOT_OF_TOP: u32 = 1u;
// #if SKY
const LIGHT_ROOT_OF_SKY: u32 = 2u;
// #endif

// What a walk chooses a child by, unless masks or portals hide a part of it.
fn light_walk_lux(packed: LightPackedChild, local: LightLocalShadingPoint, view: LightNodeView) -> f32 {
    // #if SEGMENTS
    if local.segment.w > 0.0 {
        return light_importance_along(packed, local, view).lux;
    }
    // #endif
    return light_rough(packed, local, view);
}

// What a walk chooses one of a node's children by. `local` is the shading point in the node's space.
fn light_rough_weights(
    place: LightPlace, shading_point: LightShadingPoint, local: LightLocalShadingPoint,
) -> LightLanes {
    let in_top = place.instance == LIGHT_NO_INSTANCE;
    let at = place.index * light_params.node_stride;
    let view = light_node_view(light_quad(in_top, at), local);
    var met = 0xffu;
    // #if MASKS
    met = light_met_children(in_top, place.index, shading_point.mask);
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
    for (var slot = 0u; slot < LIGHT_WIDTH; slot++) {
        let packed = light_packed_child(in_top, at, slot);
        if !light_has_flux(packed) || (met & (1u << slot)) == 0u {
            continue;
        }
        var lux = light_walk_lux(packed, local, view);
        // #if SKY
        // #if PORTALS
        if portals != 0u {
            lux *= light_portal_share(portals, light_quad(in_top, at), packed, shading_point);
        }
        // #endif
        // #endif
        // #if MASKS
        lux *= light_seen_share(in_top, packed.child_bits, shading_point.mask);
        // #endif
        light_set_lane(&lanes, slot, lux);
    }
    // #if SEGMENTS
    lanes = light_weights(lanes);
    // #endif
    return lanes;
}

// Finds the row of the point's cell, or the roots. Without a row, each root and all directional lights together have
// the same part.
fn light_new_cut(cut: ptr<function, LightCut>, directional_lux: f32, shading_point: LightShadingPoint) {
    // Some drivers need a read before the loop: see the test
    // `a_shader_may_choose_lights_where_some_invocations_have_returned`.
    if light_params.slots == 0u {
        return;
    }
    // #if ROWS
    (*cut).row = light_shared_cut(shading_point);
    if (*cut).row != 0u {
        (*cut).total = light_shared_total((*cut).row, directional_lux);
        return;
    }
    // #endif
    for (var slot = 0u; slot < LIGHT_WIDTH; slot++) {
        let is_lit = light_has_flux(light_packed_child(true, 0u, slot));
        (*cut).roots |= select(0u, LIGHT_ROOT_OF_TOP, is_lit);
    }
    // #if SKY
    (*cut).roots |= select(0u, LIGHT_ROOT_OF_SKY, light_sees_sky(shading_point));
    // #endif
    (*cut).total = f32(countOneBits((*cut).roots)) * select(1.0, directional_lux, directional_lux > 0.0);
}

// The probability of each root, without a row.
fn light_root_pmf(roots: u32) -> f32 {
    return 1.0 / max(f32(countOneBits(roots)), 1.0);
}

// Chooses a light, or returns a pmf of 0. The numbers of `start_outer` decide in the cut and the top level, those
// of `start_inner` in the tree of an instance. Twin of `descend`.
fn light_descend(
    cut: ptr<function, LightCut>, shading_point: LightShadingPoint, start_outer: LightDice, start_inner: LightDice,
) -> LightPick {
    if (*cut).total <= 0.0 {
        return LightPick(0u, 0u, 0.0);
    }
    var outer = start_outer;
    var inner = start_inner;
    var pmf = 1.0;
    var place = LightPlace(LIGHT_NO_INSTANCE, 0u);
    if (*cut).row != 0u {
        let chosen = light_choose_shared((*cut).row, outer.u);
        place = chosen.place;
        pmf = chosen.pmf;
        outer = light_remap(outer, chosen.offset, pmf);
    }
    // #if SKY
    if ((*cut).roots & LIGHT_ROOT_OF_SKY) != 0u {
        pmf = light_root_pmf((*cut).roots);
        let before = 1.0 - pmf;
        let is_sky = outer.u >= before;
        outer = light_remap(outer, outer.u - select(0.0, before, is_sky), pmf);
        if is_sky {
            place = light_sky_root();
        }
    }
    // #endif
    var local: LightLocalShadingPoint;
    // No instance has this slot.
    var local_instance = LIGHT_NO_INSTANCE - 1u;
    while (place.index & LIGHT_LEAF) == 0u {
        if place.instance != local_instance {
            local = light_local_to(place.instance, shading_point);
            local_instance = place.instance;
        }
        let lanes = light_rough_weights(place, shading_point, local);
        let total = light_sum(lanes);
        if total <= 0.0 {
            return LightPick(0u, 0u, 0.0);
        }
        let in_top = place.instance == LIGHT_NO_INSTANCE;
        let point = select(inner.u, outer.u, in_top) * total;
        let lane = light_choose_lane(lanes, 0.0, point);
        let child_pmf = light_choice_pmf(lane.weight, total);
        pmf = light_joint_pmf(pmf, child_pmf);
        let offset = (point - lane.before) / total;
        if in_top {
            outer = light_remap(outer, offset, child_pmf);
        } else {
            inner = light_remap(inner, offset, child_pmf);
        }
        place = light_child_place(place, lane.slot);
    }
    return LightPick(place.instance, place.index & ~LIGHT_LEAF, pmf);
}

// The probability that light_descend ends at a light: climbs from its leaf. 0 for a light that is not there. Twin
// of `climb`.
fn light_climb(
    cut: ptr<function, LightCut>, shading_point: LightShadingPoint, slot_of_instance: u32, light: u32,
) -> f32 {
    let index = light_find(slot_of_instance, light);
    if index == LIGHT_NO_LIGHT {
        return 0.0;
    }
    var up = light_place(index);
    // The light was removed.
    if up == LIGHT_NO_PARENT {
        return 0.0;
    }
    var place = LightPlace(slot_of_instance, 0u);
    var local = light_local_to_tree(slot_of_instance, shading_point);
    var pmf = 1.0;
    // #if PREVIOUS
    // Birth numbers repeat in the end, and then the walk may lead anywhere.
    var steps = 0u;
    // #endif
    loop {
        // #if PREVIOUS
        steps++;
        if steps > LIGHT_MAX_STEPS {
            return 0.0;
        }
        // #endif
        if place.instance != LIGHT_NO_INSTANCE && light_leaves_tree(up) {
            // #if SKY
            if (*cut).row == 0u && place.instance == light_params.sky {
                let is_seen = ((*cut).roots & LIGHT_ROOT_OF_SKY) != 0u;
                return select(0.0, light_joint_pmf(pmf, light_root_pmf((*cut).roots)), is_seen);
            }
            // #endif
            up = light_place_above(place.instance, up);
            place.instance = LIGHT_NO_INSTANCE;
            local = light_local_to_top(shading_point);
            // A dark part has no leaf.
            if up == LIGHT_NO_PARENT {
                return 0.0;
            }
        }
        let in_top = place.instance == LIGHT_NO_INSTANCE;
        place.index = up / LIGHT_WIDTH;
        if !in_top {
            place.index += light_node_base(place.instance);
        }
        let slot = up % LIGHT_WIDTH;
        // #if ROWS
        if (*cut).row != 0u {
            let shared_pmf = light_shared_pmf((*cut).row, place, slot);
            if shared_pmf >= 0.0 {
                return light_joint_pmf(pmf, shared_pmf);
            }
        }
        // #endif
        let lanes = light_rough_weights(place, shading_point, local);
        let four = select(lanes.first, lanes.last, slot >= 4u);
        pmf = light_joint_pmf(pmf, light_choice_pmf(four[slot % 4u], light_sum(lanes)));
        if pmf <= 0.0 {
            return 0.0;
        }
        up = light_parent(in_top, place.index);
        // The root of the top level is in every row.
        if in_top && up == LIGHT_NO_PARENT {
            break;
        }
    }
    return light_joint_pmf(pmf, light_root_pmf((*cut).roots));
}

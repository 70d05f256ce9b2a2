// Chooses lights by the cut of a cell and by rough estimates below it; from the roots where the cell has no cut.
// Twin of src/sampling/walk.rs with src/sampling/cuts/placed.rs and src/sampling/roots.rs. Reads the buffers that sample.wgsl binds.

// What a point chooses from.
struct LightCut {
    // The row of its cell, as in light_shared_cut; 0 for the roots of the trees.
    row: u32,
    // Contested nodes, as in light_shared_cut, and what all other candidates of the row weigh: 1 without such nodes.
    contested: vec2<u32>,
    rest: f32,
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

const LIGHT_ALL_CHILDREN: u32 = 0xffu;

// A node, and the bits of the children to choose from.
struct LightFrom {
    place: LightPlace,
    children: u32,
}

// What a walk chooses one of a node's children by, for those with a bit in `children`. `local` is the shading point in
// the node's space.
fn light_rough_weights(
    place: LightPlace, shading_point: LightShadingPoint, local: LightLocalShadingPoint, children: u32,
    // #if LEARNS
    learnt: LightCell,
    // #endif
) -> LightLanes {
    let in_top = place.instance == LIGHT_NO_INSTANCE;
    let at = place.index * LIGHT_NODE_QUADS;
    let view = light_node_view(light_quad(in_top, at), local);
    var met = children;
    // #if MASKS
    met &= light_met_children(in_top, place.index, shading_point.mask);
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
        // #if LEARNS
        lux *= light_child_share(packed, view, place.instance, local, learnt);
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
    let shared_cut = light_shared_cut(shading_point);
    if shared_cut.x != 0u {
        (*cut).row = shared_cut.x;
        (*cut).contested = shared_cut.yz;
        (*cut).total = light_shared_total(shared_cut.x, directional_lux);
        (*cut).rest = bitcast<f32>(light_cuts.quads[shared_cut.x].y);
        return;
    }
    for (var slot = 0u; slot < LIGHT_WIDTH; slot++) {
        let is_lit = light_has_flux(light_packed_child(true, 0u, slot));
        (*cut).roots |= select(0u, LIGHT_ROOT_OF_TOP, is_lit);
    }
    // #if SKY
    (*cut).roots |= select(0u, LIGHT_ROOT_OF_SKY, light_sees_sky(shading_point));
    // #endif
    (*cut).total = f32(countOneBits((*cut).roots)) * select(1.0, directional_lux, directional_lux > 0.0);
}

// The next contested node, and the bits of its children that are candidates; 0 after the last one.
fn light_next_contested(row: u32, contested: ptr<function, vec2<u32>>) -> LightFrom {
    let bytes = *contested & vec2(0xffu);
    *contested >>= vec2(8u);
    return LightFrom(light_row_node(row, bytes.x), bytes.y);
}

// #if LEARNS
// What the point has learnt, if it weighs contested nodes.
fn light_cell_of_contested(contested: vec2<u32>, shading_point: LightShadingPoint) -> LightCell {
    var learnt: LightCell;
    learnt.row = LIGHT_NO_ROW;
    if contested.y != 0u {
        learnt = light_cell(shading_point);
    }
    return learnt;
}

// That, or nothing learnt for nodes below the row.
fn light_learnt_where(is_contested: bool, learnt: LightCell) -> LightCell {
    var known = learnt;
    known.row = select(LIGHT_NO_ROW, learnt.row, is_contested);
    return known;
}
// #endif

// The probability of each root, without a row.
fn light_root_pmf(roots: u32) -> f32 {
    return 1.0 / max(f32(countOneBits(roots)), 1.0);
}

// Chooses a light, or returns a pmf of 0. The numbers of `start_outer` decide in the cut and the top level, those
// of `start_inner` in the tree of an instance. Twin of `descend` and, with a row, of `WeighedCut::choose`.
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
    // What candidates weigh so far, and the contested nodes that are still to be weighed.
    var sum = (*cut).rest;
    var contested = (*cut).contested;
    // #if LEARNS
    let learnt = light_cell_of_contested(contested, shading_point);
    // #endif
    if (*cut).row != 0u {
        let chosen = light_choose_shared((*cut).row, outer.u);
        place = chosen.place;
        pmf = chosen.pmf;
        if pmf > 0.0 {
            outer = light_remap(outer, chosen.offset, pmf);
        }
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
    loop {
        let is_contested = contested.y != 0u;
        if !is_contested && (place.index & LIGHT_LEAF) != 0u {
            break;
        }
        var now = LightFrom(place, LIGHT_ALL_CHILDREN);
        if is_contested {
            now = light_next_contested((*cut).row, &contested);
        }
        if now.place.instance != local_instance {
            local = light_local_to(now.place.instance, shading_point);
            local_instance = now.place.instance;
        }
        let lanes = light_rough_weights(
            now.place, shading_point, local, now.children,
            // #if LEARNS
            light_learnt_where(is_contested, learnt),
            // #endif
        );
        let of_node = light_sum(lanes);
        let before = select(0.0, sum, is_contested);
        sum = before + of_node;
        if sum <= 0.0 {
            if is_contested {
                continue;
            }
            return LightPick(0u, 0u, 0.0);
        }
        let by_outer = is_contested || now.place.instance == LIGHT_NO_INSTANCE;
        let point = select(inner.u, outer.u, by_outer) * sum;
        // What was chosen before stays, or a child takes its place.
        let stays = is_contested && point >= of_node && before > 0.0;
        let lane = light_choose_lane(lanes, 0.0, point);
        let weight = select(lane.weight, before, stays);
        let part = light_choice_pmf(weight, sum);
        let offset = (point - select(lane.before, of_node, stays)) / sum;
        pmf = select(light_joint_pmf(pmf, part), part, is_contested && !stays);
        if by_outer {
            outer = light_remap(outer, offset, part);
        } else {
            inner = light_remap(inner, offset, part);
        }
        if !stays {
            place = light_child_place(now.place, lane.slot);
        }
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
    var local: LightLocalShadingPoint;
    // No instance has this slot.
    var local_instance = LIGHT_NO_INSTANCE - 1u;
    var pmf = 1.0;
    // What all candidates weigh, once no contested nodes are left.
    var sum = (*cut).rest;
    var contested = (*cut).contested;
    // #if LEARNS
    let learnt = light_cell_of_contested(contested, shading_point);
    // #endif
    loop {
        let is_contested = contested.y != 0u;
        var now = LightFrom(place, LIGHT_ALL_CHILDREN);
        // Whether the walk may begin at the node.
        var is_start = false;
        if is_contested {
            now = light_next_contested((*cut).row, &contested);
        }
        if !is_contested {
            if place.instance != LIGHT_NO_INSTANCE && light_leaves_tree(up) {
                // #if SKY
                if (*cut).row == 0u && place.instance == light_params.sky {
                    let is_seen = ((*cut).roots & LIGHT_ROOT_OF_SKY) != 0u;
                    return select(0.0, light_joint_pmf(pmf, light_root_pmf((*cut).roots)), is_seen);
                }
                // #endif
                up = light_place_above(place.instance, up);
                place.instance = LIGHT_NO_INSTANCE;
                // A dark part has no leaf.
                if up == LIGHT_NO_PARENT {
                    return 0.0;
                }
            }
            place.index = up / LIGHT_WIDTH;
            if place.instance != LIGHT_NO_INSTANCE {
                place.index += light_node_base(place.instance);
            }
            now.place = place;
            if (*cut).row != 0u {
                let index = light_row_index((*cut).row, place);
                is_start = light_is_contested((*cut).contested, index, up % LIGHT_WIDTH);
                if !is_start && index != LIGHT_SHARED_NODES {
                    let shared_pmf = light_shared_pmf((*cut).row, index, up % LIGHT_WIDTH);
                    return light_joint_pmf(pmf, light_joint_pmf(light_choice_pmf((*cut).rest, sum), shared_pmf));
                }
            }
        }
        if now.place.instance != local_instance {
            local = light_local_to(now.place.instance, shading_point);
            local_instance = now.place.instance;
        }
        let lanes = light_rough_weights(
            now.place, shading_point, local, now.children,
            // #if LEARNS
            light_learnt_where(is_contested || is_start, learnt),
            // #endif
        );
        if is_contested {
            sum += light_sum(lanes);
            continue;
        }
        let slot = up % LIGHT_WIDTH;
        let four = select(lanes.first, lanes.last, slot >= 4u);
        pmf = light_joint_pmf(pmf, light_choice_pmf(four[slot % 4u], select(light_sum(lanes), sum, is_start)));
        if is_start || pmf <= 0.0 {
            return pmf;
        }
        let in_top = place.instance == LIGHT_NO_INSTANCE;
        up = light_parent(in_top, place.index);
        // The root of the top level is in every row.
        if in_top && up == LIGHT_NO_PARENT {
            break;
        }
    }
    return light_joint_pmf(pmf, light_root_pmf((*cut).roots));
}

// Draws a light: chooses a candidate of the cut and descends from it to a leaf. Computes the
// probability of a light on the way up. Twin of src/sampling/walk.rs. Reads the buffers that
// sample.wgsl binds.

// Chooses a light, or returns a pmf of 0. The numbers of `start_outer` decide in the top level,
// those of `start_inner` in the tree of an instance. Twin of `descend`.
fn light_descend(
    cut: ptr<function, LightCut>, shading_point: LightShadingPoint, start_outer: LightDice, start_inner: LightDice,
) -> LightPick {
    var total = (*cut).total;
    if total <= 0.0 {
        return LightPick(0u, 0u, 0.0);
    }
    var outer = start_outer;
    var inner = start_inner;
    var pmf = 1.0;
    var point = outer.u * total;
    // First a node of the cut, whose children are weighed again, then one of them.
    let chosen = light_choose_lane((*cut).sums, 0.0, point);
    var start = chosen.before;
    var skipped = light_split_children(cut, chosen.slot);
    var place = light_cut_place((*cut).links, chosen.slot);
    var is_first = true;
    var local: LightLocalShadingPoint;
    // No instance has this slot.
    var local_instance = LIGHT_NO_INSTANCE - 1u;
    loop {
        if place.instance != local_instance {
            local = light_local_to(place.instance, shading_point);
            local_instance = place.instance;
        }
        let in_top = place.instance == LIGHT_NO_INSTANCE;
        var lanes = light_weigh(cut, place, shading_point, local, false, skipped);
        if is_first {
            lanes = light_scale_unresolved(lanes, (*cut).unresolved);
        } else {
            lanes = light_weights(lanes);
            total = light_sum(lanes);
            if total <= 0.0 {
                break;
            }
            start = 0.0;
            point = select(inner.u, outer.u, in_top) * total;
        }
        let lane = light_choose_lane(lanes, start, point);
        let child_pmf = light_choice_pmf(lane.weight, total);
        pmf = light_joint_pmf(pmf, child_pmf);
        let offset = (point - lane.before) / total;
        if in_top || is_first {
            outer = light_remap(outer, offset, child_pmf);
        } else {
            inner = light_remap(inner, offset, child_pmf);
        }
        place = light_child_place(place, lane.slot);
        if (place.index & LIGHT_LEAF) != 0u {
            return LightPick(place.instance, place.index & ~LIGHT_LEAF, pmf);
        }
        is_first = false;
        skipped = 0u;
    }
    return LightPick(0u, 0u, 0.0);
}

// The probability that light_descend ends at a light: climbs from its leaf to the lowest split node.
// 0 for a light that is not there. Twin of `climb`.
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
            up = light_place_above(place.instance, up);
            place.instance = LIGHT_NO_INSTANCE;
            local = light_local_to_top(shading_point);
        }
        let in_top = place.instance == LIGHT_NO_INSTANCE;
        // A dark part has no leaf. The root of the top level is always in the cut.
        if in_top && up == LIGHT_NO_PARENT {
            return 0.0;
        }
        place.index = up / LIGHT_WIDTH;
        if !in_top {
            place.index += light_node_base(place.instance);
        }
        var skipped = 0u;
        let number = light_number_in_cut(cut, place);
        let in_cut = number < LIGHT_CUT_NODES;
        if in_cut {
            skipped = light_split_children(cut, number);
        }
        var lanes = light_weigh(cut, place, shading_point, local, false, skipped);
        var total = (*cut).total;
        if in_cut {
            lanes = light_scale_unresolved(lanes, (*cut).unresolved);
        } else {
            lanes = light_weights(lanes);
            total = light_sum(lanes);
        }
        let slot = up % LIGHT_WIDTH;
        let four = select(lanes.first, lanes.last, slot >= 4u);
        pmf = light_joint_pmf(pmf, light_choice_pmf(four[slot % 4u], total));
        if in_cut || pmf <= 0.0 {
            break;
        }
        up = light_parent(in_top, place.index);
    }
    return pmf;
}

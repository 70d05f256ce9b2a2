// Draws a light: chooses a candidate of the cut and descends from it to a leaf. Computes the
// probability of a light on the way up. Twin of src/walk.rs. Reads the buffers that sample.wgsl
// binds.

// Chooses a light, or returns a pmf of 0. The numbers of `start_outer` decide in the top level,
// those of `start_inner` in the tree of an instance. Twin of `descend`.
fn light_descend(
    cut: ptr<function, LightCut>, shading_point: LightShadingPoint, start_outer: LightDice, start_inner: LightDice,
) -> LightPick {
    var pick = LightPick(0u, 0u, 0.0);
    let cut_total = (*cut).total;
    if cut_total <= 0.0 {
        return pick;
    }
    var outer = start_outer;
    var inner = start_inner;
    let cut_point = outer.u * cut_total;
    var before = 0.0;
    var entry = 0u;
    var entry_before = 0.0;
    for (var i = 0u; i < (*cut).node_count; i++) {
        if (*cut).totals[i] > 0.0 && cut_point >= before {
            entry = i;
            entry_before = before;
        }
        before += (*cut).totals[i];
    }
    let candidate = light_choose_lane((*cut).weights[entry], entry_before, cut_point);
    var pmf = light_choice_pmf(candidate.weight, cut_total);
    outer = light_remap(outer, (cut_point - candidate.before) / cut_total, pmf);
    var instance = (*cut).instances[entry];
    var index = (*cut).nodes[entry];
    var slot = candidate.slot;
    var base = 0u;
    if instance != LIGHT_NO_INSTANCE {
        base = light_node_base(instance);
    }
    var local = light_local_to(instance, shading_point);
    loop {
        var bits = light_target(instance == LIGHT_NO_INSTANCE, index, slot);
        if instance == LIGHT_NO_INSTANCE && (bits & LIGHT_LEAF) != 0u {
            let part = light_part(bits);
            instance = part.slot;
            bits = part.target_bits;
            base = light_node_base(instance);
            local = light_local_to_tree(instance, shading_point);
        }
        if (bits & LIGHT_LEAF) != 0u {
            pick = LightPick(instance, bits & ~LIGHT_LEAF, pmf);
            break;
        }
        index = base + bits;
        let in_top = instance == LIGHT_NO_INSTANCE;
        // #if MASKS
        local.met_children = light_met_children(in_top, index, shading_point.mask);
        // #endif
        let weights = light_child_weights(light_node(in_top, index), local);
        let total = light_sum(weights);
        if total <= 0.0 {
            break;
        }
        let point = select(inner.u, outer.u, in_top) * total;
        let lane = light_choose_lane(weights, 0.0, point);
        let child_pmf = light_choice_pmf(lane.weight, total);
        pmf = light_joint_pmf(pmf, child_pmf);
        let offset = (point - lane.before) / total;
        if in_top {
            outer = light_remap(outer, offset, child_pmf);
        } else {
            inner = light_remap(inner, offset, child_pmf);
        }
        slot = lane.slot;
    }
    return pick;
}

// The probability that light_descend ends at a light: climbs from its leaf to the lowest split
// node. Twin of `climb`.
fn light_climb(
    cut: ptr<function, LightCut>, shading_point: LightShadingPoint, slot_of_instance: u32, light: u32,
) -> f32 {
    var instance = slot_of_instance;
    // A slot without an instance, or with one that is not shown.
    let flags = light_instance(instance).flags;
    if (flags & LIGHT_LIVE) == 0u {
        return 0.0;
    }
    // The buffers hold either the lights of the tree or their stand-ins.
    if ((flags & LIGHT_STANDS_IN) != 0u) != (light >= LIGHT_STAND_IN) {
        return 0.0;
    }
    var base = light_node_base(instance);
    var local = light_local_to_tree(instance, shading_point);
    var place = light_place(light_light_base(instance) + light);
    // The light was removed.
    if place == LIGHT_NO_PARENT {
        return 0.0;
    }
    var pmf = 1.0;
    // #if PREVIOUS
    // A light that did not exist in the last frame may lead anywhere.
    var steps = 0u;
    // #endif
    loop {
        // #if PREVIOUS
        steps++;
        if steps > LIGHT_MAX_STEPS {
            return 0.0;
        }
        // #endif
        if instance != LIGHT_NO_INSTANCE && light_leaves_tree(flags, place) {
            place = light_place_above(instance, flags, place, light);
            instance = LIGHT_NO_INSTANCE;
            base = 0u;
            local = light_local_to_top(shading_point);
        }
        let in_top = instance == LIGHT_NO_INSTANCE;
        // A dark part has no leaf. The root of the top level is always in the cut.
        if in_top && place == LIGHT_NO_PARENT {
            pmf = 0.0;
            break;
        }
        let index = base + place / LIGHT_WIDTH;
        let slot = place % LIGHT_WIDTH;
        var entry = 0u;
        while entry < (*cut).node_count && ((*cut).nodes[entry] != index || (*cut).instances[entry] != instance) {
            entry++;
        }
        if entry < (*cut).node_count {
            pmf = light_joint_pmf(pmf, light_choice_pmf((*cut).weights[entry][slot / 4u][slot % 4u], (*cut).total));
            break;
        }
        let node = light_node(in_top, index);
        // #if MASKS
        local.met_children = light_met_children(in_top, index, shading_point.mask);
        // #endif
        var weights = light_child_weights(node, local);
        pmf = light_joint_pmf(pmf, light_choice_pmf(weights[slot / 4u][slot % 4u], light_sum(weights)));
        place = node.tail.x;
        if pmf <= 0.0 {
            break;
        }
    }
    return pmf;
}

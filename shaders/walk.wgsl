// Chooses a light: opens the clusters that matter most near the shading point, chooses among all that are left, and walks down
// from there. Twin of src/walk.rs, which explains it. Reads the buffers that sample.wgsl binds.

// Opened nodes; the root is always one.
const LIGHT_BLOCKS: u32 = LIGHT_MAX_SPLITS + 1u;

// The candidates of a shading point: the children of the opened nodes.
struct LightCut {
    count: u32,
    // Estimated illuminance of all candidates, in lux.
    total: f32,
    // For each opened node the slot of the instance whose tree it is in, or LIGHT_NO_INSTANCE; its index; the sum of its
    // children's values; and the child in most doubt, the first of equals, with its doubt.
    instances: array<u32, LIGHT_BLOCKS>,
    nodes: array<u32, LIGHT_BLOCKS>,
    totals: array<f32, LIGHT_BLOCKS>,
    doubtful: array<u32, LIGHT_BLOCKS>,
    most_doubt: array<f32, LIGHT_BLOCKS>,
    // Importance of each child; 0 for one that was opened itself.
    values: array<mat2x4<f32>, LIGHT_BLOCKS>,
    // Importance times spread; 0 for what cannot be opened.
    doubts: array<mat2x4<f32>, LIGHT_BLOCKS>,
}

// A child and where its share of the line begins.
struct LightLane {
    slot: u32,
    before: f32,
    value: f32,
}

// A shading point seen in the top level.
fn light_view_of_world(shading_point: LightShadingPoint) -> LightView {
    var view: LightView;
    view.position = shading_point.position;
    view.normal = light_normalize_or_zero(shading_point.normal);
    view.has_normal = any(view.normal != vec3(0.0));
    view.margin = LIGHT_POSITION_MARGIN;
    // #if RANGES
    view.range_scale = 1.0;
    // #endif
    // #if CONES
    view.keeps_angles = true;
    // #endif
    return view;
}

// A shading point seen in an instance's tree.
fn light_view_of_tree(instance: u32, shading_point: LightShadingPoint) -> LightView {
    let place = light_instance(instance);
    var view: LightView;
    view.position = light_into_tree(place, shading_point.position - light_translation(place.to_world));
    view.normal = light_normalize_or_zero(light_transposed(place.to_world, shading_point.normal));
    view.has_normal = any(view.normal != vec3(0.0));
    view.margin = LIGHT_POSITION_MARGIN + LIGHT_RIGID_TOLERANCE;
    // #if RANGES
    view.range_scale = 1.0;
    // #endif
    // #if CONES
    view.keeps_angles = true;
    // #endif
    // #if NON_RIGID
    let squeeze = max(sqrt(place.to_local[2].w) * place.to_local[1].w, 1.0);
    view.margin = LIGHT_POSITION_MARGIN * squeeze + LIGHT_RIGID_TOLERANCE;
    // #if RANGES
    view.range_scale = place.to_local[1].w;
    // #endif
    // #if CONES
    view.keeps_angles = (place.flags & LIGHT_KEEPS_ANGLES) != 0u;
    // #endif
    // #endif
    return view;
}

fn light_view(instance: u32, shading_point: LightShadingPoint) -> LightView {
    if instance == LIGHT_NO_INSTANCE {
        return light_view_of_world(shading_point);
    }
    return light_view_of_tree(instance, shading_point);
}

// Sum of a block's values, and its child in most doubt.
fn light_count_block(cut: ptr<function, LightCut>, block: u32) {
    (*cut).totals[block] = light_sum((*cut).values[block]);
    // Without the last bits, in which the CPU keeps the slot.
    var slot = 0u;
    var most = 0u;
    for (var i = 0u; i < LIGHT_WIDTH; i++) {
        let doubt = bitcast<u32>((*cut).doubts[block][i / 4u][i % 4u]) & ~(LIGHT_WIDTH - 1u);
        if doubt > most {
            slot = i;
            most = doubt;
        }
    }
    (*cut).doubtful[block] = slot;
    (*cut).most_doubt[block] = bitcast<f32>(most);
}

// The children of a node become candidates.
fn light_add_block(cut: ptr<function, LightCut>, instance: u32, index: u32, shading_point: LightShadingPoint) {
    let in_top = instance == LIGHT_NO_INSTANCE;
    let node = light_node(in_top, index);
    let seen = light_see(node, light_view(instance, shading_point));
    let can_open = vec4(in_top);
    let block = (*cut).count;
    (*cut).count = block + 1u;
    (*cut).instances[block] = instance;
    (*cut).nodes[block] = index;
    (*cut).values[block] = seen.importance;
    (*cut).doubts[block] = mat2x4(
        select(vec4(0.0), seen.importance[0] * seen.spread[0], can_open | ((node.targets[0] & vec4(LIGHT_LEAF)) == vec4(0u))),
        select(vec4(0.0), seen.importance[1] * seen.spread[1], can_open | ((node.targets[1] & vec4(LIGHT_LEAF)) == vec4(0u))),
    );
    light_count_block(cut, block);
}

// Opens the root of the top level and then, up to light_params.splits times, the candidate in most doubt.
fn light_open(cut: ptr<function, LightCut>, shading_point: LightShadingPoint) {
    let splits = min(light_params.splits, LIGHT_MAX_SPLITS);
    (*cut).count = 0u;
    var instance = LIGHT_NO_INSTANCE;
    var index = 0u;
    loop {
        light_add_block(cut, instance, index, shading_point);
        let count = (*cut).count;
        var total = 0.0;
        for (var i = 0u; i < count; i++) {
            total += (*cut).totals[i];
        }
        (*cut).total = total;
        var most = LIGHT_MIN_DOUBT * total;
        var block = count;
        for (var i = 0u; i < count; i++) {
            if (*cut).most_doubt[i] > most {
                most = (*cut).most_doubt[i];
                block = i;
            }
        }
        if block == count || count > splits {
            return;
        }
        instance = (*cut).instances[block];
        let slot = (*cut).doubtful[block];
        let bits = light_target(instance == LIGHT_NO_INSTANCE, (*cut).nodes[block], slot);
        if (bits & LIGHT_LEAF) != 0u {
            // Only the top level's leaves are ever in doubt.
            instance = bits & ~LIGHT_LEAF;
            index = light_node_base(instance);
        } else if instance == LIGHT_NO_INSTANCE {
            index = bits;
        } else {
            index = light_node_base(instance) + bits;
        }
        (*cut).values[block][slot / 4u][slot % 4u] = 0.0;
        (*cut).doubts[block][slot / 4u][slot % 4u] = 0.0;
        light_count_block(cut, block);
    }
}

// The lane whose share of the line holds `point`; `start` is where the first begins.
fn light_pick_lane(all: mat2x4<f32>, start: f32, point: f32) -> LightLane {
    var values = all;
    var before = start;
    var chosen = LightLane(0u, start, 0.0);
    for (var slot = 0u; slot < LIGHT_WIDTH; slot++) {
        let value = values[slot / 4u][slot % 4u];
        if value > 0.0 && point >= before {
            chosen = LightLane(slot, before, value);
        }
        before += value;
    }
    return chosen;
}

// Chooses a light; the first dice decide in the top level, `inside` in an instance's tree.
fn light_descend(cut: ptr<function, LightCut>, shading_point: LightShadingPoint, start: LightDice, inside: LightDice) -> LightPick {
    let none = LightPick(0u, 0u, 0.0);
    let cut_total = (*cut).total;
    if cut_total <= 0.0 {
        return none;
    }
    var outer = start;
    var inner = inside;
    let cut_point = outer.u * cut_total;
    var before = 0.0;
    var block = 0u;
    var block_before = 0.0;
    for (var i = 0u; i < (*cut).count; i++) {
        if (*cut).totals[i] > 0.0 && cut_point >= before {
            block = i;
            block_before = before;
        }
        before += (*cut).totals[i];
    }
    let first = light_pick_lane((*cut).values[block], block_before, cut_point);
    var pmf = light_share(first.value, cut_total);
    outer = light_stretch(outer, (cut_point - first.before) / cut_total, pmf);
    var instance = (*cut).instances[block];
    var index = (*cut).nodes[block];
    var slot = first.slot;
    var base = 0u;
    if instance != LIGHT_NO_INSTANCE {
        base = light_node_base(instance);
    }
    var view = light_view(instance, shading_point);
    loop {
        let bits = light_target(instance == LIGHT_NO_INSTANCE, index, slot);
        if (bits & LIGHT_LEAF) == 0u {
            index = base + bits;
        } else if instance == LIGHT_NO_INSTANCE {
            instance = bits & ~LIGHT_LEAF;
            base = light_node_base(instance);
            view = light_view_of_tree(instance, shading_point);
            index = base;
        } else {
            return LightPick(instance, bits & ~LIGHT_LEAF, pmf);
        }
        let in_top = instance == LIGHT_NO_INSTANCE;
        let seen = light_see(light_node(in_top, index), view);
        if seen.total <= 0.0 {
            return none;
        }
        let u = select(inner.u, outer.u, in_top);
        let point = u * seen.total;
        let lane = light_pick_lane(seen.importance, 0.0, point);
        let chance = light_share(lane.value, seen.total);
        pmf = light_joint(pmf, chance);
        let offset = (point - lane.before) / seen.total;
        if in_top {
            outer = light_stretch(outer, offset, chance);
        } else {
            inner = light_stretch(inner, offset, chance);
        }
        slot = lane.slot;
    }
    return none;
}

// The chance that light_descend ends at a light: climbs from its leaf to the lowest opened node.
fn light_climb(cut: ptr<function, LightCut>, shading_point: LightShadingPoint, slot_of_instance: u32, light: u32) -> f32 {
    var instance = slot_of_instance;
    // A slot without an instance, or with one that is hidden by a scale of zero.
    if (light_instance(instance).flags & LIGHT_LIVE) == 0u {
        return 0.0;
    }
    var base = light_node_base(instance);
    var view = light_view_of_tree(instance, shading_point);
    var place = light_place(light_light_base(instance) + light);
    var pmf = 1.0;
    loop {
        let in_top = instance == LIGHT_NO_INSTANCE;
        let index = base + place / LIGHT_WIDTH;
        let slot = place % LIGHT_WIDTH;
        for (var i = 0u; i < (*cut).count; i++) {
            if (*cut).nodes[i] == index && (*cut).instances[i] == instance {
                return light_joint(pmf, light_share((*cut).values[i][slot / 4u][slot % 4u], (*cut).total));
            }
        }
        let node = light_node(in_top, index);
        let seen = light_see(node, view);
        var values = seen.importance;
        pmf = light_joint(pmf, light_share(values[slot / 4u][slot % 4u], seen.total));
        if pmf <= 0.0 {
            return 0.0;
        }
        place = node.tail.x;
        if place == LIGHT_NO_PARENT {
            if in_top {
                return 0.0;
            }
            place = light_top_place(instance);
            instance = LIGHT_NO_INSTANCE;
            base = 0u;
            view = light_view_of_world(shading_point);
        }
    }
    return 0.0;
}

// Splits the clusters near the shading point, so that one light is chosen among all candidates that
// are left. Twin of src/cut.rs, which explains it. Reads the buffers that sample.wgsl binds.

// The nodes whose children may be candidates: the root and one node for each split.
const LIGHT_CUT_NODES: u32 = LIGHT_MAX_SPLITS + 1u;

// The candidates of a shading point: the children of the nodes that were split.
struct LightCut {
    node_count: u32,
    // The sum of all weights: the estimated illuminance by all candidates, in lux.
    total: f32,
    has_unresolved: bool,
    // For each split node: the slot of the instance whose tree it is in, or LIGHT_NO_INSTANCE; its
    // index in its buffer; the sum of the weights, without unresolved children until the last
    // split.
    instances: array<u32, LIGHT_CUT_NODES>,
    nodes: array<u32, LIGHT_CUT_NODES>,
    totals: array<f32, LIGHT_CUT_NODES>,
    // The child with the greatest doubt, the first of equals, and its doubt.
    doubtful_slots: array<u32, LIGHT_CUT_NODES>,
    max_doubts: array<f32, LIGHT_CUT_NODES>,
    // The importance of each child; 0 for a child that was split itself. After the last split the
    // weights: none is negative then, and unresolved ones are limited.
    weights: array<mat2x4<f32>, LIGHT_CUT_NODES>,
    // Importance times relative doubt; 0 for what cannot be split.
    doubts: array<mat2x4<f32>, LIGHT_CUT_NODES>,
    // #if LEARNS
    cell: LightCell,
    // #endif
}

// A child and where its part of the line of weights begins.
struct LightLane {
    slot: u32,
    before: f32,
    weight: f32,
}

// A shading point in the space of the top level, which is the world.
fn light_local_to_top(shading_point: LightShadingPoint) -> LightLocalShadingPoint {
    var local: LightLocalShadingPoint;
    local.position = shading_point.position;
    local.normal = light_normalize_or_zero(shading_point.normal);
    local.has_normal = any(local.normal != vec3(0.0));
    local.margin = LIGHT_POSITION_MARGIN;
    local.light_bit = LIGHT_SINGLE;
    // #if GLOSSY
    local.gloss = shading_point.gloss;
    // #endif
    // #if SEGMENTS
    if light_is_segment(shading_point) {
        local.segment = light_local_segment(shading_point.segment);
    }
    // #endif
    // #if RANGES
    local.range_scale = 1.0;
    // #endif
    // #if FACTORS
    local.brightness = 1.0;
    // #endif
    // #if NON_RIGID
    local.scaled_instance = LIGHT_NO_INSTANCE;
    // #if CONES
    local.turn = vec2(1.0, 0.0);
    // #endif
    // #endif
    return local;
}

// A shading point in the space of an instance's tree. Twin of `Placed::local_shading_point`.
fn light_local_to_tree(instance: u32, shading_point: LightShadingPoint) -> LightLocalShadingPoint {
    let placed = light_instance(instance);
    var local: LightLocalShadingPoint;
    local.position = light_into_tree(placed, shading_point.position - light_translation(placed.to_world));
    local.normal = light_normalize_or_zero(light_transposed(placed.to_world, shading_point.normal));
    local.has_normal = any(local.normal != vec3(0.0));
    local.margin = LIGHT_POSITION_MARGIN + LIGHT_RIGID_TOLERANCE;
    local.light_bit = LIGHT_LEAF;
    // #if GLOSSY
    local.gloss = shading_point.gloss;
    local.gloss.tangent = light_transposed(placed.to_world, shading_point.gloss.tangent);
    local.gloss.bitangent = light_transposed(placed.to_world, shading_point.gloss.bitangent);
    // #endif
    // #if SEGMENTS
    if light_is_segment(shading_point) {
        local.segment = light_local_segment(light_into_tree(placed, shading_point.segment));
    }
    // #endif
    // #if RANGES
    local.range_scale = 1.0;
    // #endif
    // #if FACTORS
    local.brightness = light_brightness(placed.factor);
    // #endif
    // #if NON_RIGID
    let squeeze = max(sqrt(placed.to_local[2].w) * placed.to_local[1].w, 1.0);
    local.margin = LIGHT_POSITION_MARGIN * squeeze + LIGHT_RIGID_TOLERANCE;
    // #if RANGES
    local.range_scale = placed.to_local[1].w;
    // #endif
    local.scaled_instance = select(LIGHT_NO_INSTANCE, instance, (placed.flags & LIGHT_NON_RIGID) != 0u);
    // #if CONES
    local.turn = vec2(placed.cos_turn, placed.sin_turn);
    // #endif
    // #endif
    return local;
}

// A shading point in the space of an instance's tree, or of the top level for LIGHT_NO_INSTANCE.
fn light_local_to(instance: u32, shading_point: LightShadingPoint) -> LightLocalShadingPoint {
    if instance == LIGHT_NO_INSTANCE {
        return light_local_to_top(shading_point);
    }
    return light_local_to_tree(instance, shading_point);
}

// Brings the sum and the greatest doubt up to date with a node's children.
fn light_sum_up(cut: ptr<function, LightCut>, entry: u32) {
    // One huge unresolved importance would make the doubts about all others look small.
    (*cut).totals[entry] = light_resolved_sum((*cut).weights[entry]);
    // Doubts are compared without their last bits, where the CPU keeps the slot.
    var slot = 0u;
    var max_doubt = 0u;
    for (var i = 0u; i < LIGHT_WIDTH; i++) {
        let doubt = bitcast<u32>((*cut).doubts[entry][i / 4u][i % 4u]) & ~(LIGHT_WIDTH - 1u);
        if doubt > max_doubt {
            slot = i;
            max_doubt = doubt;
        }
    }
    (*cut).doubtful_slots[entry] = slot;
    (*cut).max_doubts[entry] = bitcast<f32>(max_doubt);
}

fn light_add_totals(cut: ptr<function, LightCut>) {
    var total = 0.0;
    for (var i = 0u; i < (*cut).node_count; i++) {
        total += (*cut).totals[i];
    }
    (*cut).total = total;
}

// Makes the children of a node candidates.
fn light_add_children(cut: ptr<function, LightCut>, instance: u32, index: u32, shading_point: LightShadingPoint) {
    let node = light_node(instance == LIGHT_NO_INSTANCE, index);
    var local = light_local_to(instance, shading_point);
    // #if MASKS
    local.met_children = light_met_children(instance == LIGHT_NO_INSTANCE, index, shading_point.mask);
    // #endif
    let children = light_child_importances(node, local);
    var importance = children.importance;
    // #if LEARNS
    let shares = light_visible_shares(node, instance, local.position, (*cut).cell);
    importance = mat2x4(importance[0] * shares[0], importance[1] * shares[1]);
    // #endif
    var doubts = mat2x4(importance[0] * children.doubt[0], importance[1] * children.doubt[1]);
    if children.has_unresolved {
        (*cut).has_unresolved = true;
        // Single lights cannot be split.
        let first_is_cluster = (node.targets[0] & vec4(local.light_bit)) == vec4(0u);
        let last_is_cluster = (node.targets[1] & vec4(local.light_bit)) == vec4(0u);
        let first = select(vec4(0.0), importance[0] * -LIGHT_UNRESOLVED_DOUBT, first_is_cluster);
        let last = select(vec4(0.0), importance[1] * -LIGHT_UNRESOLVED_DOUBT, last_is_cluster);
        doubts[0] = select(doubts[0], first, importance[0] < vec4(0.0));
        doubts[1] = select(doubts[1], last, importance[1] < vec4(0.0));
    }
    let entry = (*cut).node_count;
    (*cut).node_count = entry + 1u;
    (*cut).instances[entry] = instance;
    (*cut).nodes[entry] = index;
    (*cut).weights[entry] = importance;
    (*cut).doubts[entry] = doubts;
    light_sum_up(cut, entry);
    light_add_totals(cut);
}

// Limits the weights of all unresolved candidates together, relative to the other candidates and
// the directional lights, and adds them to the sums.
fn light_limit_unresolved(cut: ptr<function, LightCut>, directional_lux: f32) {
    var unresolved = 0.0;
    for (var i = 0u; i < (*cut).node_count; i++) {
        unresolved += light_unresolved_sum((*cut).weights[i]);
    }
    let scale = light_unresolved_scale((*cut).total + directional_lux, unresolved);
    for (var i = 0u; i < (*cut).node_count; i++) {
        let weights = light_scale_unresolved((*cut).weights[i], scale);
        (*cut).weights[i] = weights;
        (*cut).totals[i] = light_sum(weights);
    }
    light_add_totals(cut);
}

// Splits the root of the top level and then, up to light_params.splits times, the candidate with
// the greatest doubt. Twin of `Cut::new`.
fn light_new_cut(cut: ptr<function, LightCut>, directional_lux: f32, shading_point: LightShadingPoint) {
    let splits = min(light_params.splits, LIGHT_MAX_SPLITS);
    (*cut).node_count = 0u;
    (*cut).has_unresolved = false;
    // #if LEARNS
    (*cut).cell = light_cell(shading_point);
    // #endif
    var instance = LIGHT_NO_INSTANCE;
    var index = 0u;
    loop {
        light_add_children(cut, instance, index, shading_point);
        let count = (*cut).node_count;
        var max_doubt = LIGHT_MIN_DOUBT * (*cut).total;
        var entry = count;
        for (var i = 0u; i < count; i++) {
            if (*cut).max_doubts[i] > max_doubt {
                max_doubt = (*cut).max_doubts[i];
                entry = i;
            }
        }
        if entry == count || count > splits {
            break;
        }
        instance = (*cut).instances[entry];
        let slot = (*cut).doubtful_slots[entry];
        let bits = light_target(instance == LIGHT_NO_INSTANCE, (*cut).nodes[entry], slot);
        if (bits & LIGHT_LEAF) != 0u {
            // Single lights are never split.
            let part = light_part(bits);
            instance = part.slot;
            index = light_node_base(instance) + part.target_bits;
        } else if instance == LIGHT_NO_INSTANCE {
            index = bits;
        } else {
            index = light_node_base(instance) + bits;
        }
        (*cut).weights[entry][slot / 4u][slot % 4u] = 0.0;
        (*cut).doubts[entry][slot / 4u][slot % 4u] = 0.0;
        light_sum_up(cut, entry);
    }
    if (*cut).has_unresolved {
        light_limit_unresolved(cut, directional_lux);
    }
}

// The lane at a point of the line of weights; `start` is where the first begins.
fn light_choose_lane(lanes: mat2x4<f32>, start: f32, point: f32) -> LightLane {
    var weights = lanes;
    var before = start;
    var chosen = LightLane(0u, start, 0.0);
    for (var slot = 0u; slot < LIGHT_WIDTH; slot++) {
        let weight = weights[slot / 4u][slot % 4u];
        if weight > 0.0 && point >= before {
            chosen = LightLane(slot, before, weight);
        }
        before += weight;
    }
    return chosen;
}

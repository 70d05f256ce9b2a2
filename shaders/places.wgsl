// Nodes as places, and shading points in the space of a node. Reads the buffers that sample.wgsl binds;
// binds nothing itself.

// A node of a tree in an instance, or of the top level for LIGHT_NO_INSTANCE. `index` counts from the
// start of the buffer; for a single light it is LIGHT_LEAF with the index of the light in its tree.
struct LightPlace {
    instance: u32,
    index: u32,
}

// The node or the light that the child bits of a node name.
fn light_place_below(place: LightPlace, bits: u32) -> LightPlace {
    var below = LightPlace(place.instance, bits);
    if place.instance == LIGHT_NO_INSTANCE && (bits & LIGHT_LEAF) != 0u {
        let part = light_part(bits);
        below = LightPlace(part.slot, part.child_bits);
    }
    if below.instance != LIGHT_NO_INSTANCE && (below.index & LIGHT_LEAF) == 0u {
        below.index += light_node_base(below.instance);
    }
    return below;
}

// A child of a node, by its slot.
fn light_child_place(place: LightPlace, slot: u32) -> LightPlace {
    return light_place_below(place, light_child_bits(place.instance == LIGHT_NO_INSTANCE, place.index, slot));
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
    // #if FACTORS
    local.brightness = 1.0;
    // #endif
    // #if NON_RIGID
    local.scaled_instance = LIGHT_NO_INSTANCE;
    // #endif
    return local;
}

// A shading point in the space of an instance's tree, or in the axes of a scaled instance. Twin of
// `Placed::local_shading_point`.
fn light_local_to_tree(instance: u32, shading_point: LightShadingPoint) -> LightLocalShadingPoint {
    let placed = light_instance(instance);
    var local: LightLocalShadingPoint;
    var axes = placed.to_world;
    // #if NON_RIGID
    local.scaled_instance = LIGHT_NO_INSTANCE;
    if (placed.flags & LIGHT_NON_RIGID) != 0u {
        axes = light_axes(placed);
        local.scaled_instance = instance;
    }
    // #endif
    local.position = light_transposed(axes, shading_point.position - light_translation(placed.to_world));
    // #if SKY
    // It is as far from every point.
    let is_sky = instance == light_params.sky;
    local.position = select(local.position, vec3(0.0), is_sky);
    // #endif
    local.normal = light_normalize_or_zero(light_transposed(axes, shading_point.normal));
    local.has_normal = any(local.normal != vec3(0.0));
    local.margin = LIGHT_POSITION_MARGIN + LIGHT_RIGID_TOLERANCE;
    local.light_bit = LIGHT_LEAF;
    // #if SKY
    local.light_bit = select(LIGHT_LEAF, LIGHT_SKY_BITS, is_sky);
    // #endif
    // #if GLOSSY
    local.gloss = shading_point.gloss;
    local.gloss.tangent = light_transposed(axes, shading_point.gloss.tangent);
    local.gloss.bitangent = light_transposed(axes, shading_point.gloss.bitangent);
    // #endif
    // #if SEGMENTS
    var is_segment = light_is_segment(shading_point);
    // #if SKY
    is_segment = is_segment && !is_sky;
    // #endif
    if is_segment {
        local.segment = light_local_segment(light_transposed(axes, shading_point.segment));
    }
    // #endif
    // #if FACTORS
    local.brightness = light_brightness(placed.factor);
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

// A child and where its part of the line of weights begins.
struct LightLane {
    slot: u32,
    before: f32,
    weight: f32,
}

// The lane at a point of the line of weights; `start` is where the first begins. The last lane with
// a weight that begins at or before the point.
fn light_choose_lane(lanes: LightLanes, start: f32, point: f32) -> LightLane {
    var chosen = LightLane(0u, start, 0.0);
    var before = start;
    before = light_pass_lane(&chosen, 0u, lanes.first.x, before, point);
    before = light_pass_lane(&chosen, 1u, lanes.first.y, before, point);
    before = light_pass_lane(&chosen, 2u, lanes.first.z, before, point);
    before = light_pass_lane(&chosen, 3u, lanes.first.w, before, point);
    before = light_pass_lane(&chosen, 4u, lanes.last.x, before, point);
    before = light_pass_lane(&chosen, 5u, lanes.last.y, before, point);
    before = light_pass_lane(&chosen, 6u, lanes.last.z, before, point);
    before = light_pass_lane(&chosen, 7u, lanes.last.w, before, point);
    return chosen;
}

// Chooses a lane that begins at or before the point. Returns where the next one begins.
fn light_pass_lane(chosen: ptr<function, LightLane>, slot: u32, weight: f32, before: f32, point: f32) -> f32 {
    if weight > 0.0 && point >= before {
        *chosen = LightLane(slot, before, weight);
    }
    return before + weight;
}

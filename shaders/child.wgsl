// A child of a node as a shading point sees it, and the lobe that it shines in. Twin of parts of
// src/shading/importance.rs. Binds nothing.

// A shading point in the space of a tree, or in the axes of a scaled instance. Twin of
// `LocalShadingPoint`.
struct LightLocalShadingPoint {
    position: vec3<f32>,
    // A unit vector, or zero.
    normal: vec3<f32>,
    // False in a volume.
    has_normal: bool,
    margin: f32,
    // The bit of child bits that marks a single light: LIGHT_LEAF in a tree, LIGHT_SINGLE in the top
    // level, and either in the tree of the sky, which is at one distance from every shading point.
    light_bit: u32,
    // #if GLOSSY
    gloss: LightGloss,
    // #endif
    // #if SEGMENTS
    // The unit vector and half the length of a segment; 0 for a point.
    segment: vec4<f32>,
    // #endif
    // #if FACTORS
    // What the flux of the lights is multiplied by.
    brightness: f32,
    // #endif
    // #if NON_RIGID
    // The slot of an instance that is scaled, sheared or mirrored, or LIGHT_NO_INSTANCE.
    scaled_instance: u32,
    // #endif
}

// The importances of all eight children, or their weights.
struct LightLanes {
    first: vec4<f32>,
    last: vec4<f32>,
}

// A node as seen from a position in its space; `head` are its first 16 bytes.
fn light_view_from(head: vec4<u32>, position: vec3<f32>, margin: f32) -> LightNodeView {
    let corner = bitcast<vec3<f32>>(head.xyz);
    let reach = abs(corner) + 2.0 * LIGHT_STEPS * light_half_steps(head.w);
    return LightNodeView(corner - position, head.w, light_sum_axes(reach + abs(position)) * margin);
}

// A node as seen from a shading point.
fn light_node_view(head: vec4<u32>, local: LightLocalShadingPoint) -> LightNodeView {
    // #if NON_RIGID
    if local.scaled_instance != LIGHT_NO_INSTANCE {
        let corner = bitcast<vec3<f32>>(head.xyz);
        let reach = abs(corner) + 2.0 * LIGHT_STEPS * light_half_steps(head.w);
        let scale = sqrt(light_instance(local.scaled_instance).to_local[2].w);
        return LightNodeView(corner, head.w, light_sum_axes(reach * scale + abs(local.position)) * local.margin);
    }
    // #endif
    return light_view_from(head, local.position, local.margin);
}

// A child relative to a shading point: sums over the three axes. Coordinates themselves would need
// more registers.
struct LightChild {
    // From the shading point to the mean position: the squared length, and the part along the
    // normal.
    dist_sq: f32,
    along: f32,
    // How far the box rises above the plane through the shading point.
    highest: f32,
    // The squared distance of the box.
    gap_sq: f32,
    // Half the diagonal of the box, squared.
    radius_sq: f32,
    variance: f32,
    // The part of the variance that lies along the normal, times 3; at most the variance.
    normal_variance: f32,
    flux: f32,
    // #if GLOSSY
    // The parts of the mean position along the tangents of a glossy surface.
    tangents: vec2<f32>,
    // #endif
    // #if CONES
    // The part of the mean position along the axis of emission.
    facing: f32,
    // The centre of the box: the squared distance, and the part along the axis.
    center_sq: f32,
    center_facing: f32,
    // Length of the mean direction of emission, in [0, 1].
    axis_length: f32,
    cos_half_angle: f32,
    // #endif
    // #if RANGES
    range: f32,
    // #endif
}

// The sums over the coordinates of a child's box and mean position.
fn light_see_box(
    bounds: LightBox, packed: LightPackedChild, margin: f32, local: LightLocalShadingPoint,
) -> LightChild {
    let normal = local.normal;
    let half_size = bounds.half_size;
    let outside = max(abs(bounds.center) - (half_size + margin), vec3(0.0));
    let half_along = normal * half_size;
    let heights = normal * bounds.center + abs(normal) * half_size;
    var child: LightChild;
    child.dist_sq = light_sum_axes(bounds.toward * bounds.toward);
    child.along = light_sum_axes(normal * bounds.toward);
    child.highest = light_sum_axes(heights);
    child.gap_sq = light_sum_axes(outside * outside);
    child.radius_sq = light_sum_axes(half_size * half_size);
    let deviation = light_deviation(packed);
    child.variance = deviation * deviation * child.radius_sq;
    child.normal_variance =
        min(3.0 * (deviation * deviation) * light_sum_axes(half_along * half_along), child.variance);
    child.flux = light_upper_half(packed.mean);
    // #if GLOSSY
    child.tangents = vec2(
        light_sum_axes(local.gloss.tangent * bounds.toward), light_sum_axes(local.gloss.bitangent * bounds.toward),
    );
    // #endif
    // #if RANGES
    child.range = light_upper_half(packed.lobe.y);
    // #endif
    return child;
}

// #if CONES
// The parts of these sums that depend on the axis of emission, and the cap.
fn light_see_axis(child: ptr<function, LightChild>, axis: vec3<f32>, bounds: LightBox, packed: LightPackedChild) {
    (*child).facing = light_sum_axes(axis * bounds.toward);
    (*child).center_sq = light_sum_axes(bounds.center * bounds.center);
    (*child).center_facing = light_sum_axes(axis * bounds.center);
    let shortness = light_byte(packed.lobe.y, 0u) * (1.0 / LIGHT_STEPS);
    (*child).axis_length = 1.0 - shortness * shortness;
    let cap = light_byte(packed.lobe.x, 3u);
    (*child).cos_half_angle = select(1.0 - cap * (1.0 / LIGHT_CAP_STEPS), -1.0, cap >= 2.0 * LIGHT_CAP_STEPS);
}

// #endif

// A child as the shading point sees it. Twin of `LocalShadingPoint::child`, with the sums that
// estimates start with.
fn light_child(
    packed: LightPackedChild, view: LightNodeView, margin: f32, local: LightLocalShadingPoint,
) -> LightChild {
    // #if NON_RIGID
    if local.scaled_instance != LIGHT_NO_INSTANCE {
        return light_scaled_child(packed, view, margin, local);
    }
    // #endif
    let bounds = light_unpack_box(packed, view);
    var child = light_see_box(bounds, packed, margin, local);
    // #if CONES
    light_see_axis(&child, light_unit_axis(packed.lobe.x), bounds, packed);
    // #endif
    return child;
}

// Sets the lane of a child.
fn light_set_lane(lanes: ptr<function, LightLanes>, slot: u32, lux: f32) {
    (*lanes).first = select((*lanes).first, vec4(lux), vec4(slot) == vec4(0u, 1u, 2u, 3u));
    (*lanes).last = select((*lanes).last, vec4(lux), vec4(slot) == vec4(4u, 5u, 6u, 7u));
}

// Adds the halves first, as `running_sums` does.
fn light_sum(lanes: LightLanes) -> f32 {
    let a = lanes.first;
    let b = lanes.last;
    return ((b.w + b.z) + (b.y + b.x)) + ((a.w + a.z) + (a.y + a.x));
}

// Limits an estimate. Distances whose squares leave f32 in the space of a tiny tree may give NaN,
// which is not above the least importance; WGSL's max may keep it.
fn light_limited_importance(lux: f32) -> f32 {
    let above_least = select(LIGHT_MIN_IMPORTANCE, lux, lux > LIGHT_MIN_IMPORTANCE);
    return min(above_least, LIGHT_MAX_IMPORTANCE);
}

// #if CONES
struct LightLobe {
    // The mixture of a clamped cosine and all sides, times the distance.
    value: f32,
    // The squared width that the value is still to be divided by.
    width_sq: f32,
}

fn light_lobe(child: LightChild, spread: f32, dist_sq: f32, dist: f32) -> LightLobe {
    let length = min(child.axis_length, LIGHT_MAX_LOBE_LENGTH);
    let share = LIGHT_LOBE_SHARE * min(length * (1.0 / LIGHT_LAMBERTIAN), 1.0) * (1.0 - spread);
    let min_cos = max(3.0 * length - 2.0, 0.0);
    let width_sq = (1.0 - min_cos) * (1.0 - min_cos);
    let above = -child.facing - min_cos * dist;
    let rim = (LIGHT_RIM_WIDTH_SQ * spread + LIGHT_RIM_MIN_SQ * width_sq) * dist_sq;
    let value = (1.0 - share) * width_sq * dist + 2.0 * share * (above + sqrt(above * above + rim));
    return LightLobe(value, width_sq);
}
// #endif

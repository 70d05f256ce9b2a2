// Estimates how much light each child of a node sends to a shading point; 0 only where the child's
// bounds prove it. Twin of src/shading/importance.rs, which explains it and owns the constants.
// Binds nothing.

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

// The importance of a child.
struct LightImportance {
    // Negative if the child is unresolved.
    lux: f32,
    // The error that the estimate may have, relative to the estimate.
    doubt: f32,
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

// The squared error of a shading point's position, below which children are unresolved. `reach` is
// the sum of the coordinates.
fn light_position_error_sq(reach: f32) -> f32 {
    let error = LIGHT_POSITION_ERROR * reach + LIGHT_MIN_POSITION_ERROR;
    return (2.0 * 3.0) * (error * error);
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

// The sum of the resolved importances.
fn light_resolved_sum(lanes: LightLanes) -> f32 {
    return light_sum(LightLanes(max(lanes.first, vec4(0.0)), max(lanes.last, vec4(0.0))));
}

// The sum of the unresolved importances.
fn light_unresolved_sum(lanes: LightLanes) -> f32 {
    return light_resolved_sum(LightLanes(-lanes.first, -lanes.last));
}

// The factor that limits the sum of all unresolved importances to that of the others. Twin of
// `unresolved_scale`.
fn light_unresolved_scale(others: f32, unresolved: f32) -> f32 {
    return select(1.0, others / unresolved, others > 0.0 && unresolved > others);
}

// Turns importances into weights. Twin of `scale_unresolved`.
fn light_scale_unresolved(lanes: LightLanes, scale: f32) -> LightLanes {
    let least = vec4(LIGHT_MIN_IMPORTANCE);
    return LightLanes(
        select(lanes.first, max(-lanes.first * scale, least), lanes.first < vec4(0.0)),
        select(lanes.last, max(-lanes.last * scale, least), lanes.last < vec4(0.0)),
    );
}

fn light_has_unresolved(lanes: LightLanes) -> bool {
    return any(min(lanes.first, lanes.last) < vec4(0.0));
}

// What a walk chooses one of a node's children by: the importances, where those of unresolved
// children add up to at most the sum of the others. Twin of `ChildImportances::weights`.
fn light_weights(importances: LightLanes) -> LightLanes {
    if light_has_unresolved(importances) {
        let scale = light_unresolved_scale(light_resolved_sum(importances), light_unresolved_sum(importances));
        return light_scale_unresolved(importances, scale);
    }
    return importances;
}

// The importance of a child. Twin of `child_importances`.
fn light_importance(packed: LightPackedChild, local: LightLocalShadingPoint, view: LightNodeView) -> LightImportance {
    let is_light = (packed.child_bits & local.light_bit) != 0u;
    var child = light_child(packed, view, view.margin, local);
    let is_dark = light_is_provably_dark(child, local, view.margin);
    let error_sq = LIGHT_MEAN_ERROR_SQ * child.radius_sq + light_position_error_sq(light_sum_axes(abs(local.position)));
    let is_unresolved = child.dist_sq + child.variance <= error_sq;
    // #if FACTORS
    child.flux *= local.brightness;
    // #endif
    let estimate = light_estimate(child, is_light, local);
    let lux = select(estimate.lux, -estimate.lux, is_unresolved);
    return LightImportance(select(lux, 0.0, is_dark), estimate.doubt);
}

fn light_estimate(child: LightChild, is_light: bool, local: LightLocalShadingPoint) -> LightImportance {
    var dist_sq = max(child.dist_sq, LIGHT_MIN_IMPORTANCE);
    let spread = child.variance / (dist_sq + child.variance);

    var mean_sq = dist_sq + LIGHT_VARIANCE_SHARE * child.variance;
    var near_sq = max(child.gap_sq + LIGHT_NEAR_VARIANCE * child.variance, LIGHT_MIN_GAP * mean_sq);
    var gain = LIGHT_NEAR_GAIN;
    var width_sq = LIGHT_COSINE_WIDTH_SQ * child.normal_variance * (1.0 - spread);
    // #if SKY
    if local.light_bit == LIGHT_SKY_BITS {
        mean_sq = dist_sq + child.variance;
        near_sq = mean_sq;
        dist_sq = mean_sq;
        gain = 0.0;
        width_sq = LIGHT_COSINE_WIDTH_SQ * child.normal_variance;
    }
    // #endif
    let dist = sqrt(dist_sq);
    var doubt = select(spread * (mean_sq / near_sq), 0.0, is_light);
    let nearness = 1.0 + gain * doubt;

    let rounded = 0.5 * (child.along + sqrt(child.along * child.along + width_sq));
    let limited = min(rounded, max(child.along, 0.0) + LIGHT_HORIZON_SHARE * child.highest);
    let cosine = select(dist, max(limited, LIGHT_MIN_COSINE * dist), local.has_normal);

    var cosines = cosine * (1.0 / dist);
    var reach = mean_sq;
    // Lights that shine to all sides alike have no lobe. Their value is then the distance, and the
    // quotient is 1; a product with the inverse might not be. So all variants give such lights the
    // same bits.
    // #if CONES
    let lobe = light_lobe(child, spread, dist_sq, dist);
    cosines *= lobe.value / dist;
    reach *= lobe.width_sq;
    // #endif
    var lux = (child.flux * (1.0 / LIGHT_FOUR_PI) * nearness) * (cosines / reach);
    // #if GLOSSY
    if local.gloss.alpha > 0.0 {
        let inverse = 1.0 / dist;
        let reflected =
            light_reflected(local.gloss, child.tangents.x * inverse, child.tangents.y * inverse, cosine * inverse, spread);
        lux *= reflected.value;
        doubt += select(reflected.doubt, 0.0, is_light);
    }
    // #endif
    return LightImportance(light_limited_importance(lux), doubt);
}

// Limits an estimate. Distances whose squares leave f32 in the space of a tiny tree may give NaN,
// which is not above the least importance; WGSL's max may keep it.
fn light_limited_importance(lux: f32) -> f32 {
    let above_least = select(LIGHT_MIN_IMPORTANCE, lux, lux > LIGHT_MIN_IMPORTANCE);
    return min(above_least, LIGHT_MAX_IMPORTANCE);
}

fn light_is_provably_dark(child: LightChild, local: LightLocalShadingPoint, margin: f32) -> bool {
    // Everything is below the horizon.
    let steepness = abs(local.normal.x) + abs(local.normal.y) + abs(local.normal.z);
    var is_dark = local.has_normal & (child.highest + margin * steepness <= 0.0);
    // #if RANGES
    is_dark = is_dark | light_is_out_of_range(child);
    // #endif
    // #if CONES
    is_dark = is_dark | light_is_turned_away(child, margin);
    // #endif
    return is_dark;
}

// #if RANGES
fn light_is_out_of_range(child: LightChild) -> bool {
    let reach = child.range * (1.0 + LIGHT_COSINE_MARGIN);
    return (child.range < LIGHT_UNLIMITED_RANGE) & (child.gap_sq > reach * reach)
        & (child.gap_sq <= LIGHT_MAX_DIST_SQ);
}
// #endif

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

fn light_is_turned_away(child: LightChild, margin: f32) -> bool {
    let dist_sq = child.center_sq;
    let along = -child.center_facing;
    let across = sqrt(max(dist_sq - along * along, 0.0));
    let cos = child.cos_half_angle;
    let sin = sqrt(max(1.0 - cos * cos, 0.0));
    let slack = LIGHT_ANGLE_MARGIN * (abs(along) + across) + margin;
    let radius = sqrt(child.radius_sq) + slack;
    let beyond = across * cos - along * sin;
    let is_behind = (beyond > 0.0) & (along * cos + across * sin < -slack) & (dist_sq > radius * radius);
    return (cos > -1.0) & ((beyond > radius) | is_behind) & (dist_sq <= LIGHT_MAX_DIST_SQ);
}
// #endif

// Estimates how much light each child of a node sends to a shading point; 0 only where the child's
// bounds prove it. Twin of src/shading/importance.rs, which explains it and owns the constants.
// Binds nothing.

// The importance of a child.
struct LightImportance {
    // Negative if the child is unresolved.
    lux: f32,
    // The error that the estimate may have, relative to the estimate.
    doubt: f32,
}

// The squared error of a shading point's position, below which children are unresolved. `reach` is
// the sum of the coordinates.
fn light_position_error_sq(reach: f32) -> f32 {
    let error = LIGHT_POSITION_ERROR * reach + LIGHT_MIN_POSITION_ERROR;
    return (2.0 * 3.0) * (error * error);
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

// #if BUILDS
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
// #endif

// #if RANGES
fn light_is_out_of_range(child: LightChild) -> bool {
    let reach = child.range * (1.0 + LIGHT_COSINE_MARGIN);
    return (child.range < LIGHT_UNLIMITED_RANGE) & (child.gap_sq > reach * reach)
        & (child.gap_sq <= LIGHT_MAX_DIST_SQ);
}
// #endif

// #if BUILDS
// #if CONES
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
// #endif

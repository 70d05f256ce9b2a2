// A segment of a ray as the choice of lights sees it. Twin of src/shading/segment.rs, and of what
// src/shading/importance.rs estimates for segments; these explain it and own the constants. Binds
// nothing.

// #if SEGMENTS
// The unit vector and half the length of a segment; 0 for a vector without length.
fn light_local_segment(segment: vec3<f32>) -> vec4<f32> {
    return vec4(light_normalize_or_zero(segment), 0.5 * length(segment));
}

// A mean position as a segment sees it. Twin of `SegmentView`.
struct LightSegmentView {
    // How far the nearest point of the line lies from the segment's middle, toward its end.
    foot: f32,
    // Squared distance from the line.
    line_sq: f32,
    half_length: f32,
}

// `toward` is the vector from the middle of the segment.
fn light_segment_view(toward: vec3<f32>, segment: vec4<f32>) -> LightSegmentView {
    let foot = light_sum_axes(toward * segment.xyz);
    let across = toward - foot * segment.xyz;
    return LightSegmentView(foot, light_sum_axes(across * across), segment.w);
}

// Twin of `SegmentView::near_sq`.
fn light_near_sq(view: LightSegmentView) -> f32 {
    let beyond = view.foot - clamp(view.foot, -view.half_length, view.half_length);
    return view.line_sq + beyond * beyond;
}

// The angle of the vector (x, y) in [0, pi] for y above 0. Twin of `angle`.
fn light_angle(y: f32, x: f32) -> f32 {
    let size = abs(x);
    let is_steep = y > size;
    let z = select(y, size, is_steep) / select(size, y, is_steep);
    let z_sq = z * z;
    let high = LIGHT_ARC_TANGENT_5 + z_sq * (LIGHT_ARC_TANGENT_7 + z_sq * LIGHT_ARC_TANGENT_9);
    let flat_angle = z + z * z_sq * (LIGHT_ARC_TANGENT_3 + z_sq * high);
    let acute = select(flat_angle, 0.125 * LIGHT_FOUR_PI - flat_angle, is_steep);
    return select(acute, 0.25 * LIGHT_FOUR_PI - acute, x < 0.0);
}

// #if CONES
// A place relative to the foot, and its distance from the mean position. Twin of
// `SegmentView::halved`.
struct LightEnd {
    place: f32,
    dist: f32,
}

fn light_end(place: f32, distance_sq: f32) -> LightEnd {
    return LightEnd(place, sqrt(distance_sq + place * place));
}

fn light_halved(a: LightEnd, b: LightEnd) -> f32 {
    return (a.place * b.dist + b.place * a.dist) / (a.dist + b.dist);
}
// #endif

// A lower bound of the squared distance between a segment and the box of a child, and the squared distance of its
// centre. Twin of `gap_sq`.
struct LightGap {
    gap_sq: f32,
    center_sq: f32,
}

fn light_gap(bounds: LightBox, segment: vec4<f32>, margin: f32) -> LightGap {
    let unit = segment.xyz;
    let half_size = bounds.half_size + margin;
    let outside = max(abs(bounds.center) - (half_size + abs(unit) * segment.w), vec3(0.0));
    let apart_sq = light_sum_axes(outside * outside);
    let place = clamp(light_sum_axes(bounds.center * unit), -segment.w, segment.w);
    let away = bounds.center - place * unit;
    let away_sq = light_sum_axes(away * away);
    let box_reach = light_sum_axes(abs(away) * half_size);
    let own = abs(light_sum_axes(away * unit)) * segment.w;
    let gap = max(light_sum_axes(away * bounds.center) - own - box_reach, 0.0);
    let along_sq = gap * (gap / select(1.0, away_sq, gap > 0.0));
    return LightGap(max(along_sq, apart_sq), away_sq);
}

// #if CONES
// Whether a box emits nothing toward any point of a segment. Twin of the part of
// `segment_is_provably_dark` for cones.
fn light_is_turned_away_along(
    child: LightChild, center: vec3<f32>, axis: vec3<f32>, center_sq: f32, segment: vec4<f32>, margin: f32,
) -> bool {
    let along = -child.center_facing;
    let axis_unit = light_sum_axes(axis * segment.xyz);
    let across = -center - along * axis;
    let turn = segment.xyz - axis_unit * axis;
    let across_sq = light_sum_axes(across * across);
    let turn_sq = light_sum_axes(turn * turn);
    let product = light_sum_axes(across * turn);
    let half_length = segment.w;
    let nearest = clamp(-product / max(turn_sq, LIGHT_MIN_IMPORTANCE), -half_length, half_length);
    let place = across + nearest * turn;
    let least_sq = light_sum_axes(place * place);
    let most = sqrt(across_sq + 2.0 * half_length * abs(product) + half_length * half_length * turn_sq);
    let max_along = along + half_length * abs(axis_unit);
    let cos = child.cos_half_angle;
    let sin = sqrt(max(1.0 - cos * cos, 0.0));
    let middle = abs(along) + sqrt(across_sq);
    let slack = LIGHT_ANGLE_MARGIN * (middle + 2.0 * half_length) + margin;
    let radius = sqrt(child.radius_sq) + slack;
    let beyond = select(most, sqrt(least_sq), cos >= 0.0) * cos - max_along * sin;
    let is_behind = (cos >= 0.0) & (beyond > 0.0) & (max_along * cos + most * sin < -slack)
        & (center_sq > radius * radius);
    let farthest = middle + half_length;
    return (cos > -1.0) & ((beyond > radius) | is_behind) & (farthest * farthest <= LIGHT_MAX_DIST_SQ);
}
// #endif

// The importance and the doubt of a child for a segment. Twin of `SegmentCluster::estimate`.
// `facing_along` is the part of the segment's unit vector along the axis of emission.
fn light_estimate_along(
    child: LightChild, view: LightSegmentView, facing_along: f32, is_light: bool,
) -> LightImportance {
    let near_sq = max(light_near_sq(view), LIGHT_MIN_IMPORTANCE);
    let spread = child.variance / (near_sq + child.variance);
    let mean_sq = near_sq + LIGHT_VARIANCE_SHARE * child.variance;
    let nearer = mean_sq / max(child.gap_sq + LIGHT_NEAR_VARIANCE * child.variance, LIGHT_MIN_GAP * mean_sq);
    let doubt = select(spread * nearer, 0.0, is_light);
    let half_length = view.half_length;
    let length_sq = 4.0 * (half_length * half_length);
    let nearness =
        1.0 + LIGHT_NEAR_GAIN * doubt * ((near_sq + child.variance) / (near_sq + child.variance + length_sq));

    let soft_sq = max(view.line_sq + LIGHT_VARIANCE_SHARE * child.variance, LIGHT_MIN_IMPORTANCE);
    let y = 2.0 * half_length * sqrt(soft_sq);
    let reach = y / light_angle(y, soft_sq + (view.foot * view.foot - half_length * half_length));
    var emitted = 1.0;
    // #if CONES
    let a = light_end(-half_length - view.foot, soft_sq);
    let b = light_end(half_length - view.foot, soft_sq);
    let middle = light_end(light_halved(a, b), soft_sq);
    emitted = 0.5 * (light_emitted_along(child, view, facing_along, light_halved(a, middle))
        + light_emitted_along(child, view, facing_along, light_halved(middle, b)));
    // #endif
    let lux = child.flux * (1.0 / LIGHT_FOUR_PI) * nearness * (emitted / reach);
    return LightImportance(light_limited_importance(lux), doubt);
}

// #if CONES
// The lobe of a child toward a place of the line, relative to its foot.
fn light_emitted_along(child: LightChild, view: LightSegmentView, facing_along: f32, place: f32) -> f32 {
    let dist_sq = max(view.line_sq + place * place, LIGHT_MIN_IMPORTANCE);
    let dist = sqrt(dist_sq);
    var seen = child;
    seen.facing = child.facing - (place + view.foot) * facing_along;
    let lobe = light_lobe(seen, child.variance / (dist_sq + child.variance), dist_sq, dist);
    return lobe.value / (lobe.width_sq * dist);
}
// #endif

// The box of a child as the shading point sees it.
fn light_seen_box(packed: LightPackedChild, view: LightNodeView, local: LightLocalShadingPoint) -> LightBox {
    let bounds = light_unpack_box(packed, view);
    // #if NON_RIGID
    if local.scaled_instance != LIGHT_NO_INSTANCE {
        return light_box_in_axes(bounds, local).bounds;
    }
    // #endif
    return bounds;
}

// #if CONES
// Its axis of emission.
fn light_seen_axis(packed: LightPackedChild, local: LightLocalShadingPoint) -> vec3<f32> {
    // #if NON_RIGID
    if local.scaled_instance != LIGHT_NO_INSTANCE {
        return light_axis_in_axes(packed, light_instance(local.scaled_instance));
    }
    // #endif
    return light_unit_axis(packed.lobe.x);
}
// #endif

// Twin of `importances_along`.
fn light_importance_along(
    packed: LightPackedChild, local: LightLocalShadingPoint, view: LightNodeView,
) -> LightImportance {
    let is_light = (packed.child_bits & local.light_bit) != 0u;
    let segment = local.segment;
    let own_reach = dot(abs(segment.xyz), vec3(1.0)) * segment.w;
    let margin = view.margin + own_reach * local.margin;
    var child = light_child(packed, view, margin, local);
    let bounds = light_seen_box(packed, view, local);
    let gap = light_gap(bounds, segment, margin);
    child.gap_sq = gap.gap_sq;
    var is_dark = false;
    // #if RANGES
    is_dark = is_dark | light_is_out_of_range(child);
    // #endif
    var facing_along = 0.0;
    // #if CONES
    let axis = light_seen_axis(packed, local);
    is_dark = is_dark
        | light_is_turned_away_along(child, bounds.center, axis, gap.center_sq, segment, margin);
    facing_along = light_sum_axes(axis * segment.xyz);
    // #endif
    let seen = light_segment_view(bounds.toward, segment);
    let own = light_sum_axes(abs(local.position)) + own_reach;
    let error_sq = LIGHT_MEAN_ERROR_SQ * child.radius_sq + light_position_error_sq(own);
    let is_unresolved = light_near_sq(seen) + child.variance <= error_sq;
    // #if FACTORS
    child.flux *= local.brightness;
    // #endif
    let estimate = light_estimate_along(child, seen, facing_along, is_light);
    let lux = select(estimate.lux, -estimate.lux, is_unresolved);
    return LightImportance(select(lux, 0.0, is_dark), estimate.doubt);
}
// #endif

// A segment of a ray as the choice of lights sees it. Twin of src/segment.rs, and of what
// src/importance.rs estimates for segments; these explain it and own the constants. Binds nothing.

// #if SEGMENTS
// Whether a shading point is a segment.
fn light_is_segment(shading_point: LightShadingPoint) -> bool {
    let length_sq = dot(shading_point.segment, shading_point.segment);
    return length_sq >= LIGHT_MIN_SEGMENT_SQ && length_sq <= LIGHT_MAX_SEGMENT_SQ
        && all(light_normalize_or_zero(shading_point.normal) == vec3(0.0));
}

// The unit vector and half the length of a segment; 0 for a vector without length.
fn light_local_segment(segment: vec3<f32>) -> vec4<f32> {
    return vec4(light_normalize_or_zero(segment), 0.5 * length(segment));
}

// Four mean positions as a segment sees them. Twin of `SegmentView`.
struct LightSegmentView {
    // How far the nearest point of the line lies from the segment's middle, toward its end.
    foot: vec4<f32>,
    // Squared distance from the line.
    line_sq: vec4<f32>,
    half_length: f32,
}

// `toward` are the vectors from the middle of the segment, one row for each axis.
fn light_segment_view(toward: mat3x4<f32>, segment: vec4<f32>) -> LightSegmentView {
    let foot = toward * segment.xyz;
    let x = toward[0] - foot * segment.x;
    let y = toward[1] - foot * segment.y;
    let z = toward[2] - foot * segment.z;
    return LightSegmentView(foot, x * x + y * y + z * z, segment.w);
}

// Twin of `SegmentView::near_sq`.
fn light_near_sq(view: LightSegmentView) -> vec4<f32> {
    let beyond = view.foot - clamp(view.foot, vec4(-view.half_length), vec4(view.half_length));
    return view.line_sq + beyond * beyond;
}

// The angle of the vector (x, y) in [0, pi] for y above 0. Twin of `angle`.
fn light_angle(y: vec4<f32>, x: vec4<f32>) -> vec4<f32> {
    let size = abs(x);
    let is_steep = y > size;
    let z = select(y, size, is_steep) / select(size, y, is_steep);
    let z_sq = z * z;
    let high = LIGHT_ARC_TANGENT_5 + z_sq * (LIGHT_ARC_TANGENT_7 + z_sq * LIGHT_ARC_TANGENT_9);
    let flat_angle = z + z * z_sq * (LIGHT_ARC_TANGENT_3 + z_sq * high);
    let acute = select(flat_angle, 0.125 * LIGHT_FOUR_PI - flat_angle, is_steep);
    return select(acute, 0.25 * LIGHT_FOUR_PI - acute, x < vec4(0.0));
}

// #if CONES
// A place relative to the foot, and its distance from the mean position. Twin of
// `SegmentView::halved`.
struct LightEnds {
    place: vec4<f32>,
    dist: vec4<f32>,
}

fn light_end(place: vec4<f32>, distance_sq: vec4<f32>) -> LightEnds {
    return LightEnds(place, sqrt(distance_sq + place * place));
}

fn light_halved(a: LightEnds, b: LightEnds) -> vec4<f32> {
    return (a.place * b.dist + b.place * a.dist) / (a.dist + b.dist);
}
// #endif

// Four boxes: their centres relative to the middle of the segment, and half their sizes.
struct LightBoxes {
    center: mat3x4<f32>,
    half_size: mat3x4<f32>,
}

// Lower bounds of the squared distances between a segment and four boxes, and the squared distances
// of their centres. Twin of `gap_sq`.
struct LightGaps {
    gap_sq: vec4<f32>,
    center_sq: vec4<f32>,
}

fn light_gaps(boxes: LightBoxes, segment: vec4<f32>, margin: f32) -> LightGaps {
    let unit = segment.xyz;
    let place = clamp(boxes.center * unit, vec4(-segment.w), vec4(segment.w));
    var apart_sq = vec4(0.0);
    var away_sq = vec4(0.0);
    var center = vec4(0.0);
    var box_reach = vec4(0.0);
    var own = vec4(0.0);
    for (var k = 0u; k < 3u; k++) {
        let half_size = boxes.half_size[k] + margin;
        let outside = max(abs(boxes.center[k]) - (half_size + abs(unit[k]) * segment.w), vec4(0.0));
        apart_sq += outside * outside;
        let away = boxes.center[k] - place * unit[k];
        away_sq += away * away;
        center += away * boxes.center[k];
        box_reach += abs(away) * half_size;
        own += away * unit[k];
    }
    let gap = max(center - abs(own) * segment.w - box_reach, vec4(0.0));
    let along_sq = gap * (gap / select(vec4(1.0), away_sq, gap > vec4(0.0)));
    return LightGaps(max(along_sq, apart_sq), away_sq);
}

// The boxes of four children along one axis.
fn light_box_center(words: vec2<u32>, origin: f32, half_step: f32) -> vec4<f32> {
    return origin + (light_bytes(words.y) + light_bytes(words.x)) * half_step;
}

fn light_box_half(words: vec2<u32>, half_step: f32) -> vec4<f32> {
    return (light_bytes(words.y) - light_bytes(words.x)) * half_step;
}

// #if CONES
// Whether four boxes emit nothing toward any point of a segment. Twin of the part of
// `segment_is_provably_dark` for cones.
fn light_are_turned_away(
    four: LightFour, boxes: LightBoxes, axis: mat3x4<f32>, center_sq: vec4<f32>, segment: vec4<f32>, margin: f32,
) -> vec4<bool> {
    let along = -four.center_facing;
    let axis_unit = axis * segment.xyz;
    var across_sq = vec4(0.0);
    var turn_sq = vec4(0.0);
    var product = vec4(0.0);
    for (var k = 0u; k < 3u; k++) {
        let across = -boxes.center[k] - along * axis[k];
        let turn = segment[k] - axis_unit * axis[k];
        across_sq += across * across;
        turn_sq += turn * turn;
        product += across * turn;
    }
    let half_length = segment.w;
    let nearest = clamp(
        -product / max(turn_sq, vec4(LIGHT_MIN_IMPORTANCE)), vec4(-half_length), vec4(half_length),
    );
    var least_sq = vec4(0.0);
    for (var k = 0u; k < 3u; k++) {
        let place = -boxes.center[k] - along * axis[k] + nearest * (segment[k] - axis_unit * axis[k]);
        least_sq += place * place;
    }
    let most = sqrt(across_sq + 2.0 * half_length * abs(product) + half_length * half_length * turn_sq);
    let max_along = along + half_length * abs(axis_unit);
    let cos = four.cos_half_angle;
    let sin = sqrt(max(1.0 - cos * cos, vec4(0.0)));
    let middle = abs(along) + sqrt(across_sq);
    let slack = LIGHT_ANGLE_MARGIN * (middle + 2.0 * half_length) + margin;
    let radius = sqrt(four.radius_sq) + slack;
    let beyond = select(most, sqrt(least_sq), cos >= vec4(0.0)) * cos - max_along * sin;
    let is_behind = (cos >= vec4(0.0)) & (beyond > vec4(0.0)) & (max_along * cos + most * sin < -slack)
        & (center_sq > radius * radius);
    let farthest = middle + half_length;
    return (cos > vec4(-1.0)) & ((beyond > radius) | is_behind) & (farthest * farthest <= vec4(LIGHT_MAX_DIST_SQ));
}
// #endif

// The importances and doubts of four children for a segment. Twin of `SegmentCluster::estimate`.
// `facing_along` is the part of the segment's unit vector along the axes of emission.
fn light_estimate_along(
    four: LightFour, view: LightSegmentView, facing_along: vec4<f32>, is_light: vec4<bool>,
) -> LightFourImportances {
    let near_sq = max(light_near_sq(view), vec4(LIGHT_MIN_IMPORTANCE));
    let spread = four.variance / (near_sq + four.variance);
    let mean_sq = near_sq + LIGHT_VARIANCE_SHARE * four.variance;
    let nearer = mean_sq / max(four.gap_sq + LIGHT_NEAR_VARIANCE * four.variance, LIGHT_MIN_GAP * mean_sq);
    let doubt = select(spread * nearer, vec4(0.0), is_light);
    let half_length = view.half_length;
    let length_sq = 4.0 * (half_length * half_length);
    let nearness = 1.0 + LIGHT_NEAR_GAIN * doubt * ((near_sq + four.variance) / (near_sq + four.variance + length_sq));

    let soft_sq = max(view.line_sq + LIGHT_VARIANCE_SHARE * four.variance, vec4(LIGHT_MIN_IMPORTANCE));
    let y = 2.0 * half_length * sqrt(soft_sq);
    let reach = y / light_angle(y, soft_sq + (view.foot * view.foot - half_length * half_length));
    var emitted = vec4(1.0);
    // #if CONES
    let a = light_end(-half_length - view.foot, soft_sq);
    let b = light_end(half_length - view.foot, soft_sq);
    let middle = light_end(light_halved(a, b), soft_sq);
    emitted = 0.5 * (light_emitted_along(four, view, facing_along, light_halved(a, middle))
        + light_emitted_along(four, view, facing_along, light_halved(middle, b)));
    // #endif
    let lux = four.flux * (1.0 / LIGHT_FOUR_PI) * nearness * (emitted / reach);
    // As in light_estimate.
    let above_least = select(vec4(LIGHT_MIN_IMPORTANCE), lux, lux > vec4(LIGHT_MIN_IMPORTANCE));
    return LightFourImportances(min(above_least, vec4(LIGHT_MAX_IMPORTANCE)), doubt);
}

// #if CONES
// The lobes of four children toward places of the line, relative to their feet.
fn light_emitted_along(
    four: LightFour, view: LightSegmentView, facing_along: vec4<f32>, place: vec4<f32>,
) -> vec4<f32> {
    let dist_sq = max(view.line_sq + place * place, vec4(LIGHT_MIN_IMPORTANCE));
    let dist = sqrt(dist_sq);
    var seen = four;
    seen.facing = four.facing - (place + view.foot) * facing_along;
    let lobe = light_lobe(seen, four.variance / (dist_sq + four.variance), dist_sq, dist);
    return lobe.value / (lobe.width_sq * dist);
}
// #endif

// Twin of `importances_along`.
fn light_four_along(
    packed: LightPackedFour, is_light: vec4<bool>, local: LightLocalShadingPoint, view: LightNodeView,
) -> LightFourImportances {
    let segment = local.segment;
    let own_reach = dot(abs(segment.xyz), vec3(1.0)) * segment.w;
    let margin = view.margin + own_reach * local.margin;
    let own = abs(local.position);
    let error = LIGHT_POSITION_ERROR * (own.x + own.y + own.z + own_reach) + LIGHT_MIN_POSITION_ERROR;
    var four = light_unpack(packed, view.origin, view.half_step, vec3(0.0), margin);
    // #if NON_RIGID
    // #if CONES
    four.cos_half_angle = light_widened(four.cos_half_angle, local.turn);
    // #endif
    // #endif
    let x = vec2(packed.low.x, packed.high.x);
    let y = vec2(packed.low.y, packed.high.y);
    let z = vec2(packed.low.z, packed.high.z);
    let boxes = LightBoxes(
        mat3x4(
            light_box_center(x, view.origin.x, view.half_step.x),
            light_box_center(y, view.origin.y, view.half_step.y),
            light_box_center(z, view.origin.z, view.half_step.z),
        ),
        mat3x4(
            light_box_half(x, view.half_step.x), light_box_half(y, view.half_step.y),
            light_box_half(z, view.half_step.z),
        ),
    );
    let gaps = light_gaps(boxes, segment, margin);
    four.gap_sq = gaps.gap_sq;
    var is_lit = four.flux > vec4(0.0);
    // #if RANGES
    is_lit = is_lit & !light_is_out_of_range(four, local);
    // #endif
    var facing_along = vec4(0.0);
    // #if CONES
    let axis = light_unit_axes(packed.axis);
    is_lit = is_lit & !light_are_turned_away(four, boxes, axis, gaps.center_sq, segment, margin);
    facing_along = axis * segment.xyz;
    // #endif
    let mean = mat3x4(
        light_mean(packed.low.x, packed.high.x, packed.mean.x, view.origin.x, view.half_step.x),
        light_mean(packed.low.y, packed.high.y, packed.mean.y, view.origin.y, view.half_step.y),
        light_mean(packed.low.z, packed.high.z, packed.mean.z, view.origin.z, view.half_step.z),
    );
    var seen = light_segment_view(mean, segment);
    let near_sq = light_near_sq(seen);
    let error_sq = LIGHT_MEAN_ERROR_SQ * four.radius_sq + (2.0 * 3.0) * (error * error);
    let is_unresolved = near_sq + four.variance <= error_sq;
    // #if NON_RIGID
    if local.scaled_instance != LIGHT_NO_INSTANCE {
        light_four_into_world(
            &four, packed, local.scaled_instance, view.origin, view.half_step, vec3(0.0),
        );
        let rows = light_instance(local.scaled_instance).to_world;
        let world = light_local_segment(light_linear(rows, segment.xyz * (2.0 * segment.w)));
        seen = light_segment_view(mat3x4(mean * rows[0].xyz, mean * rows[1].xyz, mean * rows[2].xyz), world);
        four.gap_sq = gaps.gap_sq * (light_near_sq(seen) / max(near_sq, vec4(LIGHT_MIN_IMPORTANCE)));
        // #if CONES
        facing_along = light_facing_along_in_world(
            facing_along * (segment.w / world.w), packed, local.scaled_instance, world.xyz,
        );
        // #endif
    }
    // #endif
    // #if FACTORS
    four.flux *= local.brightness;
    // #endif
    let estimate = light_estimate_along(four, seen, facing_along, is_light);
    let importance = select(estimate.importance, -estimate.importance, is_unresolved);
    return LightFourImportances(select(vec4(0.0), importance, is_lit), estimate.doubt);
}
// #endif

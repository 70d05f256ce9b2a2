// Estimates how much light each child of a node sends to a shading point; 0 only where the child's
// bounds prove it. Twin of src/importance.rs, which explains it and owns the constants. Four
// children at a time, one in each lane. Binds nothing.

struct LightShadingPoint {
    // Metres, relative to the world's origin.
    position: vec3<f32>,
    // Unit normal of the side that light arrives at; zero for a point in a volume.
    normal: vec3<f32>,
    // #if GLOSSY
    gloss: LightGloss,
    // #endif
    // #if SEGMENTS
    // From the start of a segment to its end, in metres; the position is its middle. Zero for a
    // point.
    segment: vec3<f32>,
    // #endif
    // #if MASKS
    // Only lights of instances whose mask has a bit in common with this one reach the point.
    mask: u32,
    // #endif
}

// Limits coordinates to LIGHT_UNLIMITED_RANGE, which NaN becomes too. The coordinates of every
// shading point pass through here, so no other function meets a NaN from outside. Limits bits,
// because a compiler may assume that a float is no NaN, and drop comparisons that would tell.
fn light_limited(v: vec3<f32>) -> vec3<f32> {
    let bits = bitcast<vec3<u32>>(v);
    let limited = min(bits & vec3(0x7fffffffu), vec3(LIGHT_FARTHEST_BITS));
    return bitcast<vec3<f32>>((bits & vec3(0x80000000u)) | limited);
}

// A point on a surface; `normal` is a unit vector that points to the side that is shaded.
fn light_surface_point(position: vec3<f32>, normal: vec3<f32>) -> LightShadingPoint {
    var shading_point: LightShadingPoint;
    shading_point.position = light_limited(position);
    shading_point.normal = light_limited(normal);
    // #if MASKS
    shading_point.mask = 0xffffffffu;
    // #endif
    return shading_point;
}

// The same point with another mask; all bits are set in that of other points. Twin of
// `ShadingPoint::with_mask`. Returns the point as it is in shaders without MASKS.
fn light_masked_point(shading_point: LightShadingPoint, mask: u32) -> LightShadingPoint {
    var masked = shading_point;
    // #if MASKS
    masked.mask = mask;
    // #endif
    return masked;
}

// A point on a glossy surface. `view` points to the viewer, and the other arguments are the fields
// of `Gloss` in src/gloss.rs. The same as light_surface_point in shaders without GLOSSY.
fn light_glossy_point(
    position: vec3<f32>, normal: vec3<f32>, view: vec3<f32>, roughness: f32, specular: f32, diffuse: f32,
) -> LightShadingPoint {
    var shading_point = light_surface_point(position, normal);
    // #if GLOSSY
    shading_point.gloss = light_gloss(
        light_normalize_or_zero(shading_point.normal), light_limited(view), roughness, specular, diffuse,
    );
    // #endif
    return shading_point;
}

// A point in a volume, where light arrives from all sides.
fn light_volume_point(position: vec3<f32>) -> LightShadingPoint {
    return light_surface_point(position, vec3(0.0));
}

// The segment origin + t * direction of a ray through a volume, for t from 0 to `length`. Twin of
// `ShadingPoint::segment`. The point in its middle in shaders without SEGMENTS.
fn light_segment(origin: vec3<f32>, direction: vec3<f32>, length: f32) -> LightShadingPoint {
    // A vector that is limited is too long for a segment.
    let segment = light_limited(direction * length);
    let length_sq = dot(segment, segment);
    let is_segment = length_sq >= LIGHT_MIN_SEGMENT_SQ && length_sq <= LIGHT_MAX_SEGMENT_SQ;
    var shading_point = light_volume_point(select(origin, origin + 0.5 * segment, is_segment));
    // #if SEGMENTS
    shading_point.segment = select(vec3(0.0), segment, is_segment);
    // #endif
    return shading_point;
}

// A shading point in the space of a tree. Twin of `LocalShadingPoint`.
struct LightLocalShadingPoint {
    position: vec3<f32>,
    // A unit vector, or zero.
    normal: vec3<f32>,
    // False in a volume.
    has_normal: bool,
    margin: f32,
    // The bit of a target that marks a single light; 0 in the top level.
    light_bit: u32,
    // #if GLOSSY
    gloss: LightGloss,
    // #endif
    // #if SEGMENTS
    // The unit vector and half the length of a segment; 0 for a point.
    segment: vec4<f32>,
    // #endif
    // #if RANGES
    range_scale: f32,
    // #endif
    // #if MASKS
    // See `light_met_children`: those of the node whose children are evaluated next.
    met_children: u32,
    // #endif
    // #if FACTORS
    // What the flux of the lights is multiplied by.
    brightness: f32,
    // #endif
    // #if NON_RIGID
    // The slot of an instance that is scaled, sheared or mirrored, or LIGHT_NO_INSTANCE.
    scaled_instance: u32,
    // #if CONES
    // Cosine and sine of the angle by which caps are widened.
    turn: vec2<f32>,
    // #endif
    // #endif
}

// A node as seen from a shading point.
struct LightNodeView {
    // The vector from the shading point to the origin of the node's grid.
    origin: vec3<f32>,
    half_step: vec3<f32>,
    // The largest rounding error of a position.
    margin: f32,
    // The squared error of a shading point's position, below which children are unresolved.
    position_error_sq: f32,
}

struct LightFourImportances {
    importance: vec4<f32>,
    doubt: vec4<f32>,
}

// Of all eight children: the columns are children 0 to 3 and 4 to 7.
struct LightChildImportances {
    // Negative if a child is unresolved.
    importance: mat2x4<f32>,
    // The error that the estimate of a child may have, relative to the estimate.
    doubt: mat2x4<f32>,
    has_unresolved: bool,
}

// Twin of `child_importances`.
fn light_child_importances(node: LightNode, local: LightLocalShadingPoint) -> LightChildImportances {
    let corner = bitcast<vec3<f32>>(node.head.xyz);
    let origin = corner - local.position;
    let half_step = light_half_steps(node.head.w);
    let own = abs(local.position);
    let farthest = abs(corner) + 2.0 * LIGHT_STEPS * half_step + own;
    let margin = (farthest.x + farthest.y + farthest.z) * local.margin;
    let error = LIGHT_POSITION_ERROR * (own.x + own.y + own.z) + LIGHT_MIN_POSITION_ERROR;
    let error_sq = (2.0 * 3.0) * (error * error);
    let view = LightNodeView(origin, half_step, margin, error_sq);
    let first_is_light = (node.targets[0] & vec4(local.light_bit)) != vec4(0u);
    var first = light_four_importances(light_first_four(node), first_is_light, local, view);
    let last_is_light = (node.targets[1] & vec4(local.light_bit)) != vec4(0u);
    var last = light_four_importances(light_last_four(node), last_is_light, local, view);
    // #if MASKS
    let bits = vec4(local.met_children);
    first.importance = select(vec4(0.0), first.importance, (bits & vec4(1u, 2u, 4u, 8u)) != vec4(0u));
    last.importance = select(vec4(0.0), last.importance, (bits & vec4(16u, 32u, 64u, 128u)) != vec4(0u));
    // #endif
    return LightChildImportances(
        mat2x4(first.importance, last.importance), mat2x4(first.doubt, last.doubt),
        any(min(first.importance, last.importance) < vec4(0.0)),
    );
}

// Adds the halves first, as `running_sums` does.
fn light_sum(v: mat2x4<f32>) -> f32 {
    return ((v[1].w + v[1].z) + (v[1].y + v[1].x)) + ((v[0].w + v[0].z) + (v[0].y + v[0].x));
}

// The sum of the resolved importances.
fn light_resolved_sum(v: mat2x4<f32>) -> f32 {
    return light_sum(mat2x4(max(v[0], vec4(0.0)), max(v[1], vec4(0.0))));
}

// The sum of the unresolved importances.
fn light_unresolved_sum(v: mat2x4<f32>) -> f32 {
    return light_resolved_sum(mat2x4(-v[0], -v[1]));
}

// The factor that limits the sum of all unresolved importances to that of the others. Twin of
// `unresolved_scale`.
fn light_unresolved_scale(others: f32, unresolved: f32) -> f32 {
    return select(1.0, others / unresolved, others > 0.0 && unresolved > others);
}

// Turns importances into weights. Twin of `scale_unresolved`.
fn light_scale_unresolved(v: mat2x4<f32>, scale: f32) -> mat2x4<f32> {
    let least = vec4(LIGHT_MIN_IMPORTANCE);
    return mat2x4(
        select(v[0], max(-v[0] * scale, least), v[0] < vec4(0.0)),
        select(v[1], max(-v[1] * scale, least), v[1] < vec4(0.0)),
    );
}

// What a walk chooses one of a node's children by: the importances, where those of unresolved
// children add up to at most the sum of the others. Twin of `child_weights`.
fn light_child_weights(node: LightNode, local: LightLocalShadingPoint) -> mat2x4<f32> {
    let children = light_child_importances(node, local);
    var weights = children.importance;
    if children.has_unresolved {
        weights = light_scale_unresolved(
            weights, light_unresolved_scale(light_resolved_sum(weights), light_unresolved_sum(weights)),
        );
    }
    return weights;
}

fn light_four_importances(
    packed: LightPackedFour, is_light: vec4<bool>, local: LightLocalShadingPoint, view: LightNodeView,
) -> LightFourImportances {
    // #if SEGMENTS
    if local.segment.w > 0.0 {
        return light_four_along(packed, is_light, local, view);
    }
    // #endif
    var four = light_unpack(packed, view.origin, view.half_step, local.normal, view.margin);
    // #if NON_RIGID
    // #if CONES
    four.cos_half_angle = light_widened(four.cos_half_angle, local.turn);
    // #endif
    // #endif
    let is_lit = (four.flux > vec4(0.0)) & !light_is_provably_dark(four, local, view.margin);
    let error_sq = LIGHT_MEAN_ERROR_SQ * four.radius_sq + view.position_error_sq;
    let is_unresolved = four.dist_sq + four.variance <= error_sq;
    // #if NON_RIGID
    if local.scaled_instance != LIGHT_NO_INSTANCE {
        light_four_into_world(
            &four, packed, local.scaled_instance, view.origin, view.half_step, local.normal,
        );
    }
    // #endif
    // #if FACTORS
    four.flux *= local.brightness;
    // #endif
    // #if GLOSSY
    light_add_tangents(&four, packed, view.origin, view.half_step, local.gloss);
    // #endif
    let estimate = light_estimate(four, is_light, local);
    let importance = select(estimate.importance, -estimate.importance, is_unresolved);
    return LightFourImportances(select(vec4(0.0), importance, is_lit), estimate.doubt);
}

fn light_estimate(four: LightFour, is_light: vec4<bool>, local: LightLocalShadingPoint) -> LightFourImportances {
    let dist_sq = max(four.dist_sq, vec4(LIGHT_MIN_IMPORTANCE));
    let dist = sqrt(dist_sq);
    let spread = four.variance / (dist_sq + four.variance);

    let mean_sq = dist_sq + LIGHT_VARIANCE_SHARE * four.variance;
    let nearer = mean_sq / max(four.gap_sq + LIGHT_NEAR_VARIANCE * four.variance, LIGHT_MIN_GAP * mean_sq);
    var doubt = select(spread * nearer, vec4(0.0), is_light);
    let nearness = 1.0 + LIGHT_NEAR_GAIN * doubt;

    let width_sq = LIGHT_COSINE_WIDTH_SQ * four.normal_variance * (1.0 - spread);
    let rounded = 0.5 * (four.along + sqrt(four.along * four.along + width_sq));
    let limited = min(rounded, max(four.along, vec4(0.0)) + LIGHT_HORIZON_SHARE * four.highest);
    let cosine = select(dist, max(limited, LIGHT_MIN_COSINE * dist), local.has_normal);

    var cosines = cosine * (1.0 / dist);
    var reach = mean_sq;
    // Lights that shine to all sides alike have no lobe. Their value is then the distance, and the
    // quotient is 1; a product with the inverse might not be. So all variants give such lights the
    // same bits.
    // #if CONES
    let lobe = light_lobe(four, spread, dist_sq, dist);
    cosines *= lobe.value / dist;
    reach *= lobe.width_sq;
    // #endif
    var lux = (four.flux * (1.0 / LIGHT_FOUR_PI) * nearness) * (cosines / reach);
    // #if GLOSSY
    if local.gloss.alpha > 0.0 {
        let inverse = 1.0 / dist;
        let reflected = light_reflected(
            local.gloss, four.tangent * inverse, four.bitangent * inverse, cosine * inverse, spread,
        );
        lux *= reflected.value;
        doubt += select(reflected.doubt, vec4(0.0), is_light);
    }
    // #endif
    // Distances whose squares leave f32 in the space of a tiny tree may give NaN, which is not above
    // the least importance; WGSL's max may keep it.
    let above_least = select(vec4(LIGHT_MIN_IMPORTANCE), lux, lux > vec4(LIGHT_MIN_IMPORTANCE));
    return LightFourImportances(min(above_least, vec4(LIGHT_MAX_IMPORTANCE)), doubt);
}

fn light_is_provably_dark(four: LightFour, local: LightLocalShadingPoint, margin: f32) -> vec4<bool> {
    // Everything is below the horizon.
    let steepness = abs(local.normal.x) + abs(local.normal.y) + abs(local.normal.z);
    var is_dark = vec4(local.has_normal) & (four.highest + margin * steepness <= vec4(0.0));
    // #if RANGES
    is_dark = is_dark | light_is_out_of_range(four, local);
    // #endif
    // #if CONES
    is_dark = is_dark | light_is_turned_away(four, margin);
    // #endif
    return is_dark;
}

// #if RANGES
fn light_is_out_of_range(four: LightFour, local: LightLocalShadingPoint) -> vec4<bool> {
    let reach = four.range * (local.range_scale * (1.0 + LIGHT_COSINE_MARGIN));
    return (four.range < vec4(LIGHT_UNLIMITED_RANGE)) & (four.gap_sq > reach * reach)
        & (four.gap_sq <= vec4(LIGHT_MAX_DIST_SQ));
}
// #endif

// #if CONES
struct LightLobe {
    // The mixture of a clamped cosine and all sides, times the distance.
    value: vec4<f32>,
    // The squared width that the value is still to be divided by.
    width_sq: vec4<f32>,
}

fn light_lobe(four: LightFour, spread: vec4<f32>, dist_sq: vec4<f32>, dist: vec4<f32>) -> LightLobe {
    let length = min(four.axis_length, vec4(LIGHT_MAX_LOBE_LENGTH));
    let share = LIGHT_LOBE_SHARE * min(length * (1.0 / LIGHT_LAMBERTIAN), vec4(1.0)) * (1.0 - spread);
    let min_cos = max(3.0 * length - 2.0, vec4(0.0));
    let width_sq = (1.0 - min_cos) * (1.0 - min_cos);
    let above = -four.facing - min_cos * dist;
    let rim = (LIGHT_RIM_WIDTH_SQ * spread + LIGHT_RIM_MIN_SQ * width_sq) * dist_sq;
    let value = (1.0 - share) * width_sq * dist + 2.0 * share * (above + sqrt(above * above + rim));
    return LightLobe(value, width_sq);
}

fn light_is_turned_away(four: LightFour, margin: f32) -> vec4<bool> {
    let dist_sq = four.center_sq;
    let along = -four.center_facing;
    let across = sqrt(max(dist_sq - along * along, vec4(0.0)));
    let cos = four.cos_half_angle;
    let sin = sqrt(max(1.0 - cos * cos, vec4(0.0)));
    let slack = LIGHT_ANGLE_MARGIN * (abs(along) + across) + margin;
    let radius = sqrt(four.radius_sq) + slack;
    let beyond = across * cos - along * sin;
    let is_behind = (beyond > vec4(0.0)) & (along * cos + across * sin < -slack) & (dist_sq > radius * radius);
    return (cos > vec4(-1.0)) & ((beyond > radius) | is_behind) & (dist_sq <= vec4(LIGHT_MAX_DIST_SQ));
}
// #endif

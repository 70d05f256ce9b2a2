// How much light a node's children probably send to a shading point; zero only where their bounds prove it. Twin of
// src/importance.rs, which explains it and owns the constants. Four children at a time, one in each lane. Binds nothing.

struct LightShadingPoint {
    // Metres, relative to the world's origin.
    position: vec3<f32>,
    // Unit normal of the side that light arrives at; zero for a point in a volume.
    normal: vec3<f32>,
}

// A point on a surface; `normal` is a unit vector on the side that is shaded.
fn light_surface_point(position: vec3<f32>, normal: vec3<f32>) -> LightShadingPoint {
    return LightShadingPoint(position, normal);
}

// A point in a volume, which light reaches from all sides.
fn light_volume_point(position: vec3<f32>) -> LightShadingPoint {
    return LightShadingPoint(position, vec3(0.0));
}

// A shading point in the space of the nodes that are walked.
struct LightView {
    position: vec3<f32>,
    // Unit, or zero.
    normal: vec3<f32>,
    // False in a volume.
    has_normal: bool,
    margin: f32,
    // #if RANGES
    range_scale: f32,
    // #endif
    // #if CONES
    keeps_angles: bool,
    // #endif
}

struct LightSeenFour {
    importance: vec4<f32>,
    spread: vec4<f32>,
}

// Of all eight: the columns are children 0 to 3 and 4 to 7.
struct LightSeen {
    importance: mat2x4<f32>,
    spread: mat2x4<f32>,
    total: f32,
}

fn light_see(node: LightNode, view: LightView) -> LightSeen {
    let least = bitcast<vec3<f32>>(node.head.xyz);
    let origin = least - view.position;
    let half_step = light_half_steps(node.head.w);
    let far = abs(least) + 2.0 * LIGHT_STEPS * half_step + abs(view.position);
    let margin = (far.x + far.y + far.z) * view.margin;
    let first = light_see_four(light_unpack(light_first_four(node), origin, half_step), view, margin);
    let last = light_see_four(light_unpack(light_last_four(node), origin, half_step), view, margin);
    let importance = mat2x4(first.importance, last.importance);
    return LightSeen(importance, mat2x4(first.spread, last.spread), light_sum(importance));
}

// Halves first, as `running_sums` adds them.
fn light_sum(v: mat2x4<f32>) -> f32 {
    return ((v[1].w + v[1].z) + (v[1].y + v[1].x)) + ((v[0].w + v[0].z) + (v[0].y + v[0].x));
}

fn light_see_four(four: LightFour, view: LightView, margin: f32) -> LightSeenFour {
    let seen = light_estimate(four, view);
    let is_lit = (four.flux > vec4(0.0)) & !light_provably_dark(four, view, margin);
    return LightSeenFour(select(vec4(0.0), seen.importance, is_lit), seen.spread);
}

fn light_estimate(four: LightFour, view: LightView) -> LightSeenFour {
    let x = four.toward[0];
    let y = four.toward[1];
    let z = four.toward[2];
    let dist_sq = max(x * x + y * y + z * z, vec4(LIGHT_MIN_IMPORTANCE));
    let dist = sqrt(dist_sq);
    let spread = four.variance / (dist_sq + four.variance);

    let along = view.normal.x * x + view.normal.y * y + view.normal.z * z;
    let rounded = 0.5 * (along + sqrt(along * along + LIGHT_COSINE_WIDTH_SQ * spread * dist_sq));
    let cosine = select(dist, max(rounded, LIGHT_FLOOR * dist), view.has_normal);

    var cosines = cosine * (1.0 / dist);
    var reach = dist_sq + LIGHT_VARIANCE_SHARE * four.variance;
    // What shines to all sides alike has no lobe. Its value is then the distance, and their quotient 1, which a product
    // with the inverse may miss: so all variants give such lights the same bits.
    // #if CONES
    let lobe = light_lobe(four, spread, dist_sq, dist);
    cosines *= lobe.value / dist;
    reach *= lobe.width_sq;
    // #endif
    let lux = four.flux * (1.0 / LIGHT_FOUR_PI) * (cosines / reach);
    // NaN is not above the least; WGSL's max may keep it.
    let above_least = select(vec4(LIGHT_MIN_IMPORTANCE), lux, lux > vec4(LIGHT_MIN_IMPORTANCE));
    return LightSeenFour(min(above_least, vec4(LIGHT_MAX_IMPORTANCE)), spread);
}

fn light_provably_dark(four: LightFour, view: LightView, margin: f32) -> vec4<bool> {
    // Everything below the horizon.
    let n = view.normal;
    let steep = abs(n);
    let highest = margin * (steep.x + steep.y + steep.z)
        + (n.x * four.center[0] + steep.x * four.half[0])
        + (n.y * four.center[1] + steep.y * four.half[1])
        + (n.z * four.center[2] + steep.z * four.half[2]);
    var is_dark = vec4(view.has_normal) & (highest <= vec4(0.0));
    // #if RANGES
    is_dark = is_dark | light_out_of_range(four, view, margin);
    // #endif
    // #if CONES
    is_dark = is_dark | light_turned_away(four, view, margin);
    // #endif
    return is_dark;
}

// #if RANGES
// Whether everything is out of range.
fn light_out_of_range(four: LightFour, view: LightView, margin: f32) -> vec4<bool> {
    let out_x = max(abs(four.center[0]) - (four.half[0] + margin), vec4(0.0));
    let out_y = max(abs(four.center[1]) - (four.half[1] + margin), vec4(0.0));
    let out_z = max(abs(four.center[2]) - (four.half[2] + margin), vec4(0.0));
    let gap_sq = out_x * out_x + out_y * out_y + out_z * out_z;
    let reach = four.range * (view.range_scale * (1.0 + LIGHT_COSINE_MARGIN));
    return (four.range < vec4(LIGHT_UNLIMITED_RANGE)) & (gap_sq > reach * reach) & (gap_sq <= vec4(LIGHT_MAX_DIST_SQ));
}
// #endif

// #if CONES
// The mixture of a clamped cosine and all sides, times the distance, and the squared width that it is still to be
// divided by.
struct LightLobe {
    value: vec4<f32>,
    width_sq: vec4<f32>,
}

fn light_lobe(four: LightFour, spread: vec4<f32>, dist_sq: vec4<f32>, dist: vec4<f32>) -> LightLobe {
    let length = min(four.length, vec4(LIGHT_MAX_LOBE_LENGTH));
    let share = LIGHT_LOBE_SHARE * min(length * (1.0 / LIGHT_LAMBERTIAN), vec4(1.0)) * (1.0 - spread);
    let least_cos = max(3.0 * length - 2.0, vec4(0.0));
    let width_sq = (1.0 - least_cos) * (1.0 - least_cos);
    let facing = four.axis[0] * four.toward[0] + four.axis[1] * four.toward[1] + four.axis[2] * four.toward[2];
    let above = -facing - least_cos * dist;
    let rim = (LIGHT_RIM_WIDTH_SQ * spread + LIGHT_RIM_MIN_SQ * width_sq) * dist_sq;
    let value = (1.0 - share) * width_sq * dist + 2.0 * share * (above + sqrt(above * above + rim));
    return LightLobe(value, width_sq);
}

// Whether everything is turned away.
fn light_turned_away(four: LightFour, view: LightView, margin: f32) -> vec4<bool> {
    let x = four.center[0];
    let y = four.center[1];
    let z = four.center[2];
    let dist_sq = x * x + y * y + z * z;
    let along = -(four.axis[0] * x + four.axis[1] * y + four.axis[2] * z);
    let across = sqrt(max(dist_sq - along * along, vec4(0.0)));
    let cos = four.cos_half_angle;
    let sin = sqrt(max(1.0 - cos * cos, vec4(0.0)));
    let slack = LIGHT_ANGLE_MARGIN * (abs(along) + across) + margin;
    let radius = sqrt(four.radius_sq) + slack;
    let beside = across * cos - along * sin;
    let is_behind = (beside > vec4(0.0)) & (along * cos + across * sin < -slack) & (dist_sq > radius * radius);
    return vec4(view.keeps_angles) & (cos > vec4(-1.0)) & ((beside > radius) | is_behind)
        & (dist_sq <= vec4(LIGHT_MAX_DIST_SQ));
}
// #endif

// Unpacks four children of a node at a time, one in each lane. Twin of `Node::unpack` in
// src/tree/node.rs. Binds nothing.

// The packed data of four children, as stored in `LightNode`: one word per axis.
struct LightPackedFour {
    low: vec3<u32>,
    high: vec3<u32>,
    mean: vec3<u32>,
    deviation: u32,
    flux: vec2<u32>,
    // #if NON_RIGID
    // Four bits for each child, the lowest first.
    area_ratios: u32,
    // #endif
    // #if CONES
    shortness: u32,
    axis: vec3<u32>,
    cap: u32,
    // #endif
    // #if RANGES
    range: vec2<u32>,
    // #endif
}

// Four children relative to a shading point: sums over the three axes. Coordinates themselves would
// need more registers.
struct LightFour {
    // From the shading point to the mean position: the squared length, and the part along the
    // normal.
    dist_sq: vec4<f32>,
    along: vec4<f32>,
    // How far the box rises above the plane through the shading point.
    highest: vec4<f32>,
    // The squared distance of the box.
    gap_sq: vec4<f32>,
    // Half the diagonal of the box, squared.
    radius_sq: vec4<f32>,
    variance: vec4<f32>,
    // The part of the variance that lies along the normal, times 3; at most the variance.
    // `light_add_axis` sums up half the extent along the normal, squared, which `light_unpack`
    // scales.
    normal_variance: vec4<f32>,
    flux: vec4<f32>,
    // #if CONES
    // The part of the mean position along the axis of emission.
    facing: vec4<f32>,
    // The centre of the box: the squared distance, and the part along the axis.
    center_sq: vec4<f32>,
    center_facing: vec4<f32>,
    // Length of the mean direction of emission, in [0, 1].
    axis_length: vec4<f32>,
    cos_half_angle: vec4<f32>,
    // #endif
    // #if RANGES
    range: vec4<f32>,
    // #endif
    // #if GLOSSY
    // The part of the mean position along each tangent of the gloss.
    tangent: vec4<f32>,
    bitangent: vec4<f32>,
    // #endif
}

fn light_first_four(node: LightNode) -> LightPackedFour {
    let b = node.boxes;
    var four: LightPackedFour;
    four.low = vec3(b[0].x, b[0].z, b[1].x);
    four.high = vec3(b[1].z, b[2].x, b[2].z);
    four.mean = vec3(b[3].x, b[3].z, b[4].x);
    four.deviation = b[4].z;
    four.flux = node.flux.xy;
    // #if NON_RIGID
    four.area_ratios = node.tail.y;
    // #endif
    // #if CONES
    four.shortness = node.tail.z;
    four.axis = vec3(node.cones[0].x, node.cones[0].z, node.cones[1].x);
    four.cap = node.cones[1].z;
    // #endif
    // #if RANGES
    four.range = node.range.xy;
    // #endif
    return four;
}

fn light_last_four(node: LightNode) -> LightPackedFour {
    let b = node.boxes;
    var four: LightPackedFour;
    four.low = vec3(b[0].y, b[0].w, b[1].y);
    four.high = vec3(b[1].w, b[2].y, b[2].w);
    four.mean = vec3(b[3].y, b[3].w, b[4].y);
    four.deviation = b[4].w;
    four.flux = node.flux.zw;
    // #if NON_RIGID
    four.area_ratios = node.tail.y >> 16u;
    // #endif
    // #if CONES
    four.shortness = node.tail.w;
    four.axis = vec3(node.cones[0].y, node.cones[0].w, node.cones[1].y);
    four.cap = node.cones[1].w;
    // #endif
    // #if RANGES
    four.range = node.range.zw;
    // #endif
    return four;
}

// The four bytes of a word, the lowest first.
fn light_bytes(word: u32) -> vec4<f32> {
    return vec4<f32>((vec4(word) >> vec4(0u, 8u, 16u, 24u)) & vec4(0xffu));
}

// Four floats from their upper halves.
fn light_halves(words: vec2<u32>) -> vec4<f32> {
    return bitcast<vec4<f32>>(vec4(words.x << 16u, words.x & 0xffff0000u, words.y << 16u, words.y & 0xffff0000u));
}

// The power of two that is a node's step along an axis.
fn light_step(steps: u32, axis: u32) -> f32 {
    return bitcast<f32>(((steps >> (8u * axis)) & 0xffu) << 23u);
}

// Half the step of a node's grid along each axis, in metres.
fn light_half_steps(steps: u32) -> vec3<f32> {
    return 0.5 * vec3(light_step(steps, 0u), light_step(steps, 1u), light_step(steps, 2u));
}

// Adds the part of one axis to the sums. `origin` is the coordinate of the node's origin, relative
// to the shading point, and `normal` that of the normal.
fn light_add_axis(
    four: ptr<function, LightFour>, words: vec3<u32>, axis: vec4<f32>, origin: f32, half_step: f32, normal: f32,
    margin: f32,
) {
    let low = light_bytes(words.x);
    let high = light_bytes(words.y);
    let width = high - low;
    let half_size = width * half_step;
    let center = origin + (high + low) * half_step;
    let toward = origin + (low + width * (light_bytes(words.z) * (1.0 / LIGHT_STEPS))) * (2.0 * half_step);
    let outside = max(abs(center) - (half_size + margin), vec4(0.0));
    (*four).dist_sq += toward * toward;
    (*four).along += normal * toward;
    (*four).highest += normal * center + abs(normal) * half_size;
    (*four).gap_sq += outside * outside;
    (*four).radius_sq += half_size * half_size;
    (*four).normal_variance += (normal * half_size) * (normal * half_size);
    // #if CONES
    (*four).facing += axis * toward;
    (*four).center_sq += center * center;
    (*four).center_facing += axis * center;
    // #endif
}

// `origin` is the vector from the shading point to the node's origin, `normal` the normal of the
// shading point. `margin` is the largest rounding error of a position.
fn light_unpack(
    packed: LightPackedFour, origin: vec3<f32>, half_step: vec3<f32>, normal: vec3<f32>, margin: f32,
) -> LightFour {
    var four: LightFour;
    var axis = mat3x4<f32>();
    // #if CONES
    axis = light_unit_axes(packed.axis);
    // #endif
    let x = vec3(packed.low.x, packed.high.x, packed.mean.x);
    light_add_axis(&four, x, axis[0], origin.x, half_step.x, normal.x, margin);
    let y = vec3(packed.low.y, packed.high.y, packed.mean.y);
    light_add_axis(&four, y, axis[1], origin.y, half_step.y, normal.y, margin);
    let z = vec3(packed.low.z, packed.high.z, packed.mean.z);
    light_add_axis(&four, z, axis[2], origin.z, half_step.z, normal.z, margin);
    let deviation = light_bytes(packed.deviation) * (1.0 / LIGHT_STEPS);
    four.variance = deviation * deviation * four.radius_sq;
    four.normal_variance = min(3.0 * (deviation * deviation) * four.normal_variance, four.variance);
    four.flux = light_halves(packed.flux);
    // #if CONES
    let shortness = light_bytes(packed.shortness) * (1.0 / LIGHT_STEPS);
    four.axis_length = 1.0 - shortness * shortness;
    let cap = light_bytes(packed.cap);
    four.cos_half_angle = select(1.0 - cap * (1.0 / LIGHT_CAP_STEPS), vec4(-1.0), cap >= vec4(2.0 * LIGHT_CAP_STEPS));
    // #endif
    // #if RANGES
    four.range = light_halves(packed.range);
    // #endif
    return four;
}

// #if CONES
// The four signed bytes of a word, the lowest first.
fn light_signed_bytes(word: u32) -> vec4<f32> {
    return vec4<f32>(bitcast<vec4<i32>>(vec4(word) << vec4(24u, 16u, 8u, 0u)) >> vec4(24u));
}

// Four directions of unit length from their quantised coordinates.
fn light_unit_axes(packed: vec3<u32>) -> mat3x4<f32> {
    let x = light_signed_bytes(packed.x);
    let y = light_signed_bytes(packed.y);
    let z = light_signed_bytes(packed.z);
    let inverse = 1.0 / sqrt(max(x * x + y * y + z * z, vec4(1.0)));
    return mat3x4(x * inverse, y * inverse, z * inverse);
}
// #endif

// #if NON_RIGID | GLOSSY | SEGMENTS
// The coordinates of four mean positions along one axis, relative to the shading point.
fn light_mean(low_word: u32, high_word: u32, mean_word: u32, origin: f32, half_step: f32) -> vec4<f32> {
    let low = light_bytes(low_word);
    let width = light_bytes(high_word) - low;
    return origin + (low + width * (light_bytes(mean_word) * (1.0 / LIGHT_STEPS))) * (2.0 * half_step);
}
// #endif

// Unpacks four children of a node at a time, one in each lane. Twin of `Node::unpack` in
// src/tree/node.rs. Binds nothing.

// The packed data of four children, as stored in `LightNode`: one word per axis.
struct LightPackedFour {
    low: vec3<u32>,
    high: vec3<u32>,
    mean: vec3<u32>,
    deviation: u32,
    flux: vec2<u32>,
    // #if CONES
    shortness: u32,
    axis: vec3<u32>,
    cap: u32,
    // #endif
    // #if RANGES
    range: vec2<u32>,
    // #endif
}

// Four children relative to a shading point. The columns of matrices are x, y and z.
struct LightFour {
    // From the shading point to the mean position, and to the centre of the box.
    toward: mat3x4<f32>,
    center: mat3x4<f32>,
    // Half the box's edges, and their squared length.
    half_size: mat3x4<f32>,
    radius_sq: vec4<f32>,
    variance: vec4<f32>,
    flux: vec4<f32>,
    // #if CONES
    // Unit vectors.
    axis: mat3x4<f32>,
    // Length of the mean direction of emission, in [0, 1].
    axis_length: vec4<f32>,
    cos_half_angle: vec4<f32>,
    // #endif
    // #if RANGES
    range: vec4<f32>,
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

// `origin` is the vector from the shading point to the node's origin.
fn light_unpack(packed: LightPackedFour, origin: vec3<f32>, half_step: vec3<f32>) -> LightFour {
    let low = mat3x4(light_bytes(packed.low.x), light_bytes(packed.low.y), light_bytes(packed.low.z));
    let high = mat3x4(light_bytes(packed.high.x), light_bytes(packed.high.y), light_bytes(packed.high.z));
    let mean = mat3x4(light_bytes(packed.mean.x), light_bytes(packed.mean.y), light_bytes(packed.mean.z));
    var four: LightFour;
    for (var k = 0u; k < 3u; k++) {
        let width = high[k] - low[k];
        four.half_size[k] = width * half_step[k];
        four.center[k] = origin[k] + (high[k] + low[k]) * half_step[k];
        four.toward[k] = origin[k] + (low[k] + width * (mean[k] * (1.0 / LIGHT_STEPS))) * (2.0 * half_step[k]);
    }
    four.radius_sq = four.half_size[0] * four.half_size[0] + four.half_size[1] * four.half_size[1]
        + four.half_size[2] * four.half_size[2];
    let deviation = light_bytes(packed.deviation) * (1.0 / LIGHT_STEPS);
    four.variance = deviation * deviation * four.radius_sq;
    four.flux = light_halves(packed.flux);
    // #if CONES
    four.axis = light_unit_axes(packed.axis);
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

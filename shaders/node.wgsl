// Unpacks a child of a node. Twin of `Node::unpack` in src/tree/pack.rs. Binds nothing.
//
// One child at a time: the sums over four children at once would need three times the registers, and
// a GPU has work enough without them.

// The packed data of a child, as `NodeRecord` in src/plan/node_record.rs stores it.
struct LightPackedChild {
    // The child's node, or LIGHT_LEAF with what the leaf is.
    child_bits: u32,
    // Bytes, the lowest first: the minimum corner and the deviation.
    low: u32,
    // The maximum corner, and the mean position along x.
    high: u32,
    // The mean position along y and z, and the upper half of the flux.
    mean: u32,
    // #if NON_RIGID
    // Four bits: how the flux is divided between surfaces and lights without size.
    area_ratio: u32,
    // #endif
    // #if CONES | RANGES
    // The axis and the cap; the shortness, an unused byte, and the upper half of the range.
    lobe: vec2<u32>,
    // #endif
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

// A node as seen from a shading point.
struct LightNodeView {
    // The vector from the shading point to the origin of the node's grid.
    origin: vec3<f32>,
    // The steps of the grid: see `Node::steps`.
    steps: u32,
    // The largest rounding error of a position.
    margin: f32,
}

// A byte of a word; byte 0 is the lowest.
fn light_byte(word: u32, i: u32) -> f32 {
    return f32((word >> (8u * i)) & 0xffu);
}

// A float from the upper half of a word, which is its own upper half.
fn light_upper_half(word: u32) -> f32 {
    return bitcast<f32>(word & 0xffff0000u);
}

// Whether a slot has a child with any flux.
fn light_has_flux(packed: LightPackedChild) -> bool {
    return packed.mean >= 0x10000u;
}

// The power of two that is a node's step along an axis.
fn light_step(steps: u32, axis: u32) -> f32 {
    return bitcast<f32>(((steps >> (8u * axis)) & 0xffu) << 23u);
}

// Half the step of a node's grid along each axis, in metres.
fn light_half_steps(steps: u32) -> vec3<f32> {
    return 0.5 * vec3(light_step(steps, 0u), light_step(steps, 1u), light_step(steps, 2u));
}

// The corners of a child's box and its mean position, in steps and in shares of the box.
fn light_low(packed: LightPackedChild) -> vec3<f32> {
    return vec3(light_byte(packed.low, 0u), light_byte(packed.low, 1u), light_byte(packed.low, 2u));
}

fn light_high(packed: LightPackedChild) -> vec3<f32> {
    return vec3(light_byte(packed.high, 0u), light_byte(packed.high, 1u), light_byte(packed.high, 2u));
}

fn light_mean_share(packed: LightPackedChild) -> vec3<f32> {
    return vec3(light_byte(packed.high, 3u), light_byte(packed.mean, 0u), light_byte(packed.mean, 1u));
}

// The vector from the shading point to the mean position of a child. Twin of `Unpacked::toward`.
fn light_to_mean(packed: LightPackedChild, view: LightNodeView) -> vec3<f32> {
    let low = light_low(packed);
    let width = light_high(packed) - low;
    let half_step = light_half_steps(view.steps);
    return view.origin + (low + width * (light_mean_share(packed) * (1.0 / LIGHT_STEPS))) * (2.0 * half_step);
}

// The standard deviation of position, as a share of half the box's diagonal.
fn light_deviation(packed: LightPackedChild) -> f32 {
    return light_byte(packed.low, 3u) * (1.0 / LIGHT_STEPS);
}

// #if NON_RIGID
// Half the edges of a child's box, in metres.
fn light_half_size(packed: LightPackedChild, steps: u32) -> vec3<f32> {
    return (light_high(packed) - light_low(packed)) * light_half_steps(steps);
}

// The vector from the shading point to the nearest point of a child's box, less the margin along
// each axis. Twin of `Unpacked::gap`.
fn light_to_box(packed: LightPackedChild, view: LightNodeView) -> vec3<f32> {
    let center = view.origin + (light_high(packed) + light_low(packed)) * light_half_steps(view.steps);
    let outside = max(abs(center) - (light_half_size(packed, view.steps) + view.margin), vec3(0.0));
    return select(outside, -outside, center < vec3(0.0));
}
// #endif

// Unpacks a child. `normal` is that of the shading point.
fn light_unpack(packed: LightPackedChild, view: LightNodeView, normal: vec3<f32>) -> LightChild {
    let low = light_low(packed);
    let high = light_high(packed);
    let half_step = light_half_steps(view.steps);
    let half_size = (high - low) * half_step;
    let center = view.origin + (high + low) * half_step;
    let toward = light_to_mean(packed, view);
    let outside = max(abs(center) - (half_size + view.margin), vec3(0.0));
    let half_along = normal * half_size;
    let heights = normal * center + abs(normal) * half_size;
    var child: LightChild;
    child.dist_sq = light_sum_axes(toward * toward);
    child.along = light_sum_axes(normal * toward);
    child.highest = light_sum_axes(heights);
    child.gap_sq = light_sum_axes(outside * outside);
    child.radius_sq = light_sum_axes(half_size * half_size);
    let deviation = light_deviation(packed);
    child.variance = deviation * deviation * child.radius_sq;
    child.normal_variance =
        min(3.0 * (deviation * deviation) * light_sum_axes(half_along * half_along), child.variance);
    child.flux = light_upper_half(packed.mean);
    // #if CONES
    let axis = light_unit_axis(packed.lobe.x);
    child.facing = light_sum_axes(axis * toward);
    child.center_sq = light_sum_axes(center * center);
    child.center_facing = light_sum_axes(axis * center);
    let shortness = light_byte(packed.lobe.y, 0u) * (1.0 / LIGHT_STEPS);
    child.axis_length = 1.0 - shortness * shortness;
    let cap = light_byte(packed.lobe.x, 3u);
    child.cos_half_angle = select(1.0 - cap * (1.0 / LIGHT_CAP_STEPS), -1.0, cap >= 2.0 * LIGHT_CAP_STEPS);
    // #endif
    // #if RANGES
    child.range = light_upper_half(packed.lobe.y);
    // #endif
    return child;
}

// Adds the parts along x, y and z, in this order.
fn light_sum_axes(v: vec3<f32>) -> f32 {
    return v.x + v.y + v.z;
}

// #if CONES
// A direction of unit length from its three signed bytes.
fn light_unit_axis(word: u32) -> vec3<f32> {
    let bytes = bitcast<vec3<i32>>(vec3(word) << vec3(24u, 16u, 8u)) >> vec3(24u);
    let axis = vec3<f32>(bytes);
    return axis * (1.0 / sqrt(max(light_sum_axes(axis * axis), 1.0)));
}
// #endif

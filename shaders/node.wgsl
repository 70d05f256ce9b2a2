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

// The mean position of a child and its box, relative to a shading point.
struct LightBox {
    toward: vec3<f32>,
    center: vec3<f32>,
    half_size: vec3<f32>,
}

// A node as seen from a shading point.
struct LightNodeView {
    // The vector from the shading point to the origin of the node's grid; from the origin of the tree
    // if the instance is scaled.
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

// The vector to the mean position of a child from where the view's origin is relative to.
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

// Where a child lies, relative to what the view's origin is relative to. Twin of `Node::unpack`.
fn light_unpack_box(packed: LightPackedChild, view: LightNodeView) -> LightBox {
    let low = light_low(packed);
    let high = light_high(packed);
    let half_step = light_half_steps(view.steps);
    let half_size = (high - low) * half_step;
    let center = view.origin + (high + low) * half_step;
    return LightBox(light_to_mean(packed, view), center, half_size);
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

// #if NON_RIGID
// #if CONES | AREAS
// The shares of the flux of a child that come from lights without size and from surfaces. `code`
// are four bits of a node's `area_ratios`, and `steps` those of the node. Twin of
// `Node::flux_shares`.
fn light_flux_shares(code: u32, steps: u32) -> vec2<f32> {
    // 2^(code - 7 - 3 s) from its exponent.
    let shift = bitcast<i32>(steps) >> 28u;
    let ratio = bitcast<f32>(bitcast<u32>(i32(code) + 120 - 3 * shift) << 23u);
    let punctual = 1.0 / (1.0 + ratio);
    let shares = select(vec2(punctual, ratio * punctual), vec2(1.0, 0.0), code == 0u);
    return select(shares, vec2(0.0, 1.0), code == LIGHT_ALL_SURFACES);
}

// #endif
// #endif

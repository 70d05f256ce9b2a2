// The place of a position in an order that keeps neighbours together. Twin of src/tree/space_order.rs,
// which explains it. Both use only sums, powers of two and integers, so they get the same bits. Binds
// nothing; reads the variable `bounds` of the stage.
//
// `bounds` has the maxima of the `top_ordered` coordinates of all means, the maxima of their
// complements, the number of parts that shine and an unused word; then for each level of the sample
// the number of its parts. Then the codes of the corners of the box of all means; the middle and the
// power of the lens; and two words for each plane, of which the root is number 1: its axis, and where
// it is. Then the lists of the parts of each level, at most TOP_LEVEL_SAMPLES for each.

// Twin of `MIDDLE`.
const SPACE_MIDDLE: u32 = 0x40000000u;

// The exponent e of a number in [2^e, 2^(e + 1)); -127 for zero.
fn space_exponent(x: f32) -> i32 {
    return i32(bitcast<u32>(x) >> 23u) - 127;
}

// 2^e, or the nearest normal power of two.
fn space_power_of_two(e: i32) -> f32 {
    return bitcast<f32>(u32(clamp(e, -126, 127) + 127) << 23u);
}

// The code of a position. Twin of `Lens::code`.
fn space_code(position: vec3<f32>, middle: vec3<f32>, power: f32) -> vec3<u32> {
    let along = (position - middle) * power;
    let steps = bitcast<vec3<u32>>(abs(along) + 1.0) - bitcast<u32>(1.0);
    return select(SPACE_MIDDLE + steps, SPACE_MIDDLE - steps, along < vec3(0.0));
}

fn space_words(at: u32) -> vec3<u32> {
    return vec3(bounds[at], bounds[at + 1u], bounds[at + 2u]);
}

fn space_plane_word(plane: u32) -> u32 {
    return TOP_PLANES_AT + 2u * plane;
}

// The axis of the longest extent, of equals the first. Twin of `longest`.
fn space_longest(extent: vec3<u32>) -> u32 {
    let axis = select(0u, 1u, extent.y > extent.x);
    return select(axis, 2u, extent.z > extent[axis]);
}

// The key of a position, below 2^31. Twin of `SpaceOrder::key`.
fn space_key(position: vec3<f32>) -> u32 {
    var low = space_words(TOP_BOX_AT);
    var high = space_words(TOP_BOX_AT + 3u);
    let middle = bitcast<vec3<f32>>(space_words(TOP_LENS_AT));
    let code = space_code(position, middle, bitcast<f32>(bounds[TOP_LENS_AT + 3u]));
    var cell = 1u;
    var key = 0u;
    for (var i = 0u; i < TOP_KEY_BITS; i++) {
        var axis = TOP_NO_AXIS;
        var at = 0u;
        if cell < TOP_PLANES {
            axis = bounds[space_plane_word(cell)];
            at = bounds[space_plane_word(cell) + 1u];
        }
        if axis == TOP_NO_AXIS {
            axis = space_longest(high - low);
            at = low[axis] + (high[axis] - low[axis] + 1u) / 2u;
        }
        let is_above = code[axis] >= at;
        if is_above {
            low[axis] = at;
        } else {
            high[axis] = at;
        }
        if cell < TOP_PLANES {
            cell = 2u * cell + select(0u, 1u, is_above);
        }
        key = (key << 1u) | select(0u, 1u, is_above);
    }
    return key;
}

// The place of a position in an order that keeps neighbours together. Twin of src/tree/curve.rs,
// which explains it. Both use only sums, halves and integers, so they get the same bits. Binds
// nothing; reads the variable `bounds` of the stage.
//
// `bounds` has the maxima of the `top_ordered` coordinates of all means, the maxima of their
// complements, the number of parts that shine and an unused word; then for each level of the sample the
// number of its parts; then the corners of the box that planes without a median halve; then two words
// for each plane, of which the root is number 1: its axis, and where it is; then the lists of the
// parts of each level, at most TOP_LEVEL_SAMPLES for each.

fn curve_plane_word(plane: u32) -> u32 {
    return TOP_PLANES_AT + 2u * plane;
}

fn curve_corner(at: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(vec3(bounds[at], bounds[at + 1u], bounds[at + 2u]));
}

// The axis of the longest extent, of equals the first. Twin of `longest`.
fn curve_longest(extent: vec3<f32>) -> u32 {
    let axis = select(0u, 1u, extent.y > extent.x);
    return select(axis, 2u, extent.z > extent[axis]);
}

// The key of a position, below 2^31. Twin of
// `Curve::key`.
fn curve_key(position: vec3<f32>) -> u32 {
    var low = curve_corner(TOP_BOUNDS_WORDS);
    var high = curve_corner(TOP_BOUNDS_WORDS + 3u);
    var cell = 1u;
    var key = 0u;
    for (var i = 0u; i < TOP_KEY_BITS; i++) {
        var axis = TOP_NO_AXIS;
        var at = 0.0;
        if cell < TOP_PLANES {
            axis = bounds[curve_plane_word(cell)];
            at = bitcast<f32>(bounds[curve_plane_word(cell) + 1u]);
        }
        if axis == TOP_NO_AXIS {
            axis = curve_longest(high - low);
            at = (low[axis] + high[axis]) * 0.5;
        }
        let is_above = position[axis] >= at;
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

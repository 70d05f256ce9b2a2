// The place of a position on a curve through space. Twin of src/tree/curve.rs, which explains the
// curve. Both use only subtractions, powers of two and integers, so they get the same bits. Binds
// nothing; `curve_key_of` reads the variable `bounds` of the stage.

// The exponent e of a number in [2^e, 2^(e + 1)); -127 for zero.
fn curve_exponent(x: f32) -> i32 {
    return i32(bitcast<u32>(x) >> 23u) - 127;
}

// The lowest `count` bits set, `count` below 32.
fn curve_low_bits(count: u32) -> u32 {
    return (1u << count) - 1u;
}

// Turns the coordinates of a cell into the digits of its place on the Hilbert curve. Twin of
// `hilbert`.
fn curve_hilbert(cell: vec3<u32>, dimensions: u32, bits: u32) -> vec3<u32> {
    var x = cell;
    for (var up = 1u; up < bits; up++) {
        let bit = bits - up;
        let below = curve_low_bits(bit);
        for (var i = 0u; i < dimensions; i++) {
            if (x[i] & (1u << bit)) != 0u {
                x[0] ^= below;
            } else {
                let swap = (x[0] ^ x[i]) & below;
                x[0] ^= swap;
                x[i] ^= swap;
            }
        }
    }
    for (var i = 1u; i < dimensions; i++) {
        x[i] ^= x[i - 1u];
    }
    let last = x[dimensions - 1u];
    var flips = 0u;
    for (var bit = 1u; bit < bits; bit++) {
        if (last & (1u << bit)) != 0u {
            flips ^= curve_low_bits(bit);
        }
    }
    return x ^ vec3(flips);
}

// Appends the digits' bits to a key, the highest of all digits first.
fn curve_append(start: u32, digits: vec3<u32>, dimensions: u32, bits: u32) -> u32 {
    var key = start;
    for (var up = 1u; up <= bits; up++) {
        for (var i = 0u; i < dimensions; i++) {
            key = (key << 1u) | ((digits[i] >> (bits - up)) & 1u);
        }
    }
    return key;
}

// The key of a position within bounds, below 2^31. Twin of `Curve::key`.
fn curve_key(position: vec3<f32>, low: vec3<f32>, high: vec3<f32>) -> u32 {
    let extent = high - low;
    // The axes by extent, the longest first, x before y before z: a bubble sort of three.
    var axes = vec3(0u, 1u, 2u);
    if extent[axes.y] > extent[axes.x] { axes = axes.yxz; }
    if extent[axes.z] > extent[axes.y] { axes = axes.xzy; }
    if extent[axes.y] > extent[axes.x] { axes = axes.yxz; }
    let long = curve_exponent(extent[axes.x]);
    let middle = curve_exponent(extent[axes.y]);
    let short = curve_exponent(extent[axes.z]);
    let one = min(u32(long - middle), TOP_KEY_BITS);
    let two = min(u32(middle - short), (TOP_KEY_BITS - one) / 2u);
    let three = (TOP_KEY_BITS - one - 2u * two) / 3u;
    let power = clamp(i32(one + two + three) - 1 - long, -126, 127);
    let cells = (position - low) * bitcast<f32>(u32(power + 127) << 23u);
    let sorted = vec3(cells[axes.x], cells[axes.y], cells[axes.z]);
    let cell = min(vec3<u32>(sorted), vec3(curve_low_bits(one + two + three)));
    let flat_digits = curve_hilbert((cell >> vec3(three)) & vec3(curve_low_bits(two)), 2u, two);
    let deep_digits = curve_hilbert(cell & vec3(curve_low_bits(three)), 3u, three);
    let key = curve_append(cell.x >> (two + three), flat_digits, 2u, two);
    return curve_append(key, deep_digits, 3u, three);
}

// The key of a position within the bounds of the means of all instances.
fn curve_key_of(position: vec3<f32>) -> u32 {
    let high = vec3(top_unordered(bounds[0]), top_unordered(bounds[1]), top_unordered(bounds[2]));
    let low = vec3(top_unordered(~bounds[3]), top_unordered(~bounds[4]), top_unordered(~bounds[5]));
    return curve_key(position, low, high);
}

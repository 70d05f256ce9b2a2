// Transforms and packs clusters for the top level. Twin of src/cluster/mod.rs and of `Node::pack`;
// the tests in src/gpu/tests/top compare them. Binds nothing.

// The corner of an empty box. WGSL has no infinity, and no box extends farther.
const NOWHERE: f32 = 3.4e38;

// A cluster without light.
const CLUSTER_EMPTY = LightCluster(vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(0.0), 0.0);

// The length of a vector. The squares of components do not overflow, though areas, which grow with
// the square of a scale, may be large.
fn safe_length(v: vec3<f32>) -> f32 {
    let largest = max(abs(v.x), max(abs(v.y), abs(v.z)));
    if largest <= 0.0 {
        return 0.0;
    }
    return largest * length(v / largest);
}

// The unit vector along `v`, or `other` if `v` is zero.
fn normalize_or(v: vec3<f32>, other: vec3<f32>) -> vec3<f32> {
    let largest = max(abs(v.x), max(abs(v.y), abs(v.z)));
    if largest <= 0.0 {
        return other;
    }
    return normalize(v / largest);
}

// The map of a placement. Twin of `Linear` in src/cluster/mod.rs.
struct Linear {
    // The columns of the matrix.
    x: vec3<f32>,
    y: vec3<f32>,
    z: vec3<f32>,
    translation: vec3<f32>,
    // The columns of the cofactor matrix, negated if the map mirrors.
    area_x: vec3<f32>,
    area_y: vec3<f32>,
    area_z: vec3<f32>,
    mean_square_scale: f32,
    // The greatest factor of areas.
    greatest_area: f32,
}

// The map of a stored instance. Twin of `Linear::new`.
fn linear_of(instance: LightInstance) -> Linear {
    let rows = instance.to_world;
    let x = vec3(rows[0].x, rows[1].x, rows[2].x);
    let y = vec3(rows[0].y, rows[1].y, rows[2].y);
    let z = vec3(rows[0].z, rows[1].z, rows[2].z);
    // The matrix of cofactors is the transposed inverse times the determinant. Cross products would
    // lose the digits of flattened placements.
    let inverse = instance.to_local;
    let volume = abs(inverse[0].w);
    return Linear(
        x, y, z, vec3(rows[0].w, rows[1].w, rows[2].w),
        inverse[0].xyz * volume, inverse[1].xyz * volume, inverse[2].xyz * volume,
        inverse[2].w, volume * inverse[1].w,
    );
}

// The flux of a transformed cluster. Twin of `Linear::flux`.
fn linear_flux(map: Linear, punctual: f32, area: f32, axis: vec3<f32>) -> f32 {
    let lengths = vec3(safe_length(map.area_x), safe_length(map.area_y), safe_length(map.area_z));
    let all_sides = safe_length(lengths) * sqrt(1.0 / 3.0);
    let agreement = min(1.5 * length(axis), 1.0);
    let normal = normalize_or(axis, vec3(0.0));
    let along = safe_length(map.area_x * normal.x + map.area_y * normal.y + map.area_z * normal.z);
    return min(punctual + area * (agreement * along + (1.0 - agreement) * all_sides), LIGHT_MAX_FLUX);
}

// A cluster of a tree in the world, which must not be empty. Twin of `Cluster::transformed`.
fn cluster_transformed(tree: LightTree, instance: LightInstance, map: Linear, flux: f32) -> LightCluster {
    let cluster = tree.cluster;
    let is_kind = vec2(tree.area_flux > 0.0, tree.area_flux > 0.0 && tree.punctual_flux <= 0.0);
    let unit = normalize_or(cluster.axis, vec3(0.0));
    var image = map.x * unit.x + map.y * unit.y + map.z * unit.z;
    if is_kind.x {
        image = map.area_x * unit.x + map.area_y * unit.y + map.area_z * unit.z;
    }
    // Without an axis, the cap is all directions.
    let greatest = map.greatest_area / max(safe_length(image), 1.0e-30);
    let center = 0.5 * (cluster.box_min + cluster.box_max);
    let half = max(cluster.box_max - center, center - cluster.box_min);
    let moved_center = map.x * center.x + map.y * center.y + map.z * center.z + map.translation;
    let reach = abs(map.x) * half.x + abs(map.y) * half.y + abs(map.z) * half.z;
    let far = abs(center) + half;
    let size = abs(map.x) * far.x + abs(map.y) * far.y + abs(map.z) * far.z + abs(map.translation);
    var moved: LightCluster;
    moved.mean = map.x * cluster.mean.x + map.y * cluster.mean.y + map.z * cluster.mean.z + map.translation;
    moved.flux = flux;
    moved.box_min = moved_center - (reach + size * TRANSFORM_PADDING);
    moved.variance = cluster.variance * map.mean_square_scale;
    moved.box_max = moved_center + (reach + size * TRANSFORM_PADDING);
    moved.range = cluster.range;
    moved.axis = normalize_or(image, vec3(0.0)) * length(cluster.axis);
    moved.cos_half_angle = light_cap_cosine(cluster.cos_half_angle, is_kind, greatest, instance);
    return moved;
}

// The cosine of the cap around a unit vector that holds a cluster's cap; 1 for a dark cluster. Twin
// of `cap_about` in src/cluster/cone.rs.
fn cap_about(unit: vec3<f32>, cluster: LightCluster) -> f32 {
    let axis = cluster.axis;
    let length = sqrt(axis.x * axis.x + axis.y * axis.y + axis.z * axis.z);
    let inverse = 1.0 / select(1.0, length, length > 0.0);
    let x = axis.x * inverse;
    let y = axis.y * inverse;
    let z = axis.z * inverse;
    let cos = unit.x * x + unit.y * y + unit.z * z;
    let cross_x = unit.y * z - unit.z * y;
    let cross_y = unit.z * x - unit.x * z;
    let cross_z = unit.x * y - unit.y * x;
    let sin = sqrt(cross_x * cross_x + cross_y * cross_y + cross_z * cross_z);
    let cos_half = cluster.cos_half_angle;
    let sin_half = sqrt(max(1.0 - cos_half * cos_half, 0.0));
    let reach = cos * cos_half - sin * sin_half - CAP_PADDING;
    let is_beyond = sin * cos_half + cos * sin_half < 0.0;
    let is_all = is_beyond || cos_half <= -1.0 || reach < -1.0;
    return select(1.0, select(reach, -1.0, is_all), cluster.flux > 0.0);
}

// The biased exponent of the smallest power of two of which LIGHT_STEPS steps reach from `low` to
// `high`; 0 if these are equal. Twin of `step_bits` in src/tree. Differs: it tries up to four
// exponents, because a division in WGSL may be less accurate than in Rust.
fn step_bits(low: f32, high: f32) -> u32 {
    if high <= low {
        return 0u;
    }
    var bits = max(bitcast<u32>((high - low) / LIGHT_STEPS) >> 23u, 1u);
    for (var i = 0u; i < 4u && low + LIGHT_STEPS * bitcast<f32>(bits << 23u) < high; i++) {
        bits++;
    }
    return bits;
}

// A whole number as a byte. Rounding may have moved it out of a byte's range, so it is clamped.
fn pack_byte(x: f32) -> u32 {
    return u32(clamp(x, 0.0, LIGHT_STEPS));
}

// A whole number from -128 to 127 as a byte.
fn pack_signed_byte(x: f32) -> u32 {
    return bitcast<u32>(i32(x)) & 0xffu;
}

// The upper half of a float. `rounding` is added to its bits first: 0x8000 rounds to nearest, 0xffff
// rounds up.
fn pack_half(x: f32, rounding: u32) -> u32 {
    return (bitcast<u32>(x) + rounding) >> 16u;
}

// The box and the mean of a child along one axis.
struct PackedAxis {
    low: u32,
    high: u32,
    mean: u32,
    // The size of the unpacked box.
    size: f32,
}

// Packs a child along one axis; `bits` is the exponent of the grid's step.
fn pack_axis(origin: f32, bits: u32, box_min: f32, box_max: f32, mean: f32, is_lit: bool) -> PackedAxis {
    let step = bitcast<f32>(bits << 23u);
    // The inverse of a power of two from its exponent is exact, while a division may not be.
    let per_step = select(0.0, bitcast<f32>((254u - bits) << 23u), bits > 0u);
    let lower = select(origin, box_min, is_lit);
    let upper = select(origin, box_max, is_lit);
    // The unpacked box must hold the box, so a corner that was rounded inward moves by one more
    // step.
    var low = round((lower - origin) * per_step);
    low -= select(0.0, 1.0, origin + low * step > lower);
    var high = round((upper - origin) * per_step);
    high += select(0.0, 1.0, origin + high * step < upper);
    let start = origin + low * step;
    let size = (origin + high * step) - start;
    let share = (mean - start) / select(1.0, size, size > 0.0);
    let steps = select(0.0, trunc(share * LIGHT_STEPS + 0.5), is_lit);
    return PackedAxis(pack_byte(low), pack_byte(high), pack_byte(steps), size);
}

// Rounds to the nearest whole number, halves away from zero.
fn rounded_signed(x: f32) -> f32 {
    return trunc(x + select(0.5, -0.5, x < 0.0));
}

// A child as a node stores it: see LightPackedChild. Its child bits are missing.
struct PackedChild {
    low: u32,
    high: u32,
    mean: u32,
    lobe: vec2<u32>,
}

// Packs a child into a node with this origin and these exponents of its steps. Twin of `Node::pack`.
// A dark child gets the values of a light without a cone and without a range.
fn child_packed(child: LightCluster, origin: vec3<f32>, bits: vec3<u32>) -> PackedChild {
    let is_lit = child.flux > 0.0;
    let x = pack_axis(origin.x, bits.x, child.box_min.x, child.box_max.x, child.mean.x, is_lit);
    let y = pack_axis(origin.y, bits.y, child.box_min.y, child.box_max.y, child.mean.y, is_lit);
    let z = pack_axis(origin.z, bits.z, child.box_min.z, child.box_max.z, child.mean.z, is_lit);
    let half_diagonal_sq = 0.25 * x.size * x.size + 0.25 * y.size * y.size + 0.25 * z.size * z.size;
    let ratio_sq = child.variance / select(1.0, half_diagonal_sq, half_diagonal_sq > 0.0);
    let deviation = pack_byte(trunc(sqrt(ratio_sq) * LIGHT_STEPS + 0.5));

    let axis = child.axis;
    let length = sqrt(axis.x * axis.x + axis.y * axis.y + axis.z * axis.z);
    let has_axis = is_lit && length > 0.0;
    let to_steps = LIGHT_DIRECTION_STEPS / select(1.0, length, has_axis);
    let axis_x = select(0.0, rounded_signed(axis.x * to_steps), has_axis);
    let axis_y = select(0.0, rounded_signed(axis.y * to_steps), has_axis);
    let axis_z = select(LIGHT_DIRECTION_STEPS, rounded_signed(axis.z * to_steps), has_axis);
    let inverse = 1.0 / sqrt(axis_x * axis_x + axis_y * axis_y + axis_z * axis_z);
    let cap = cap_about(vec3(axis_x * inverse, axis_y * inverse, axis_z * inverse), child);
    let cap_steps = select(2.0 * LIGHT_CAP_STEPS, ceil((1.0 - cap) * LIGHT_CAP_STEPS), is_lit);
    let shortness = trunc(sqrt(1.0 - select(0.0, min(length, 1.0), is_lit)) * LIGHT_STEPS + 0.5);
    let range = select(LIGHT_UNLIMITED_RANGE, min(child.range, LIGHT_UNLIMITED_RANGE), is_lit);

    return PackedChild(
        x.low | (y.low << 8u) | (z.low << 16u) | (deviation << 24u),
        x.high | (y.high << 8u) | (z.high << 16u) | (x.mean << 24u),
        y.mean | (z.mean << 8u) | (pack_half(child.flux, 0x8000u) << 16u),
        vec2(
            pack_signed_byte(axis_x) | (pack_signed_byte(axis_y) << 8u) | (pack_signed_byte(axis_z) << 16u)
                | (pack_byte(cap_steps) << 24u),
            pack_byte(shortness) | (pack_half(range, 0xffffu) << 16u),
        ),
    );
}

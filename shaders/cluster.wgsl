// Transforms, merges and packs clusters for the top level. Twin of src/cluster.rs, of `WideCluster`
// in src/tree/wide.rs and of `Node::pack`; the tests in src/gpu/tests/top compare them. Binds
// nothing.

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

// The map of a placement. Twin of `Linear` in src/cluster.rs.
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
    // Cosine and sine of the angle by which caps are widened.
    turn: vec2<f32>,
    mean_square_scale: f32,
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
        vec2(instance.cos_turn, instance.sin_turn), instance.to_local[2].w,
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

// The cosine of the half-angle of a widened cap. Twin of `Linear::widened`.
fn linear_widened(map: Linear, cos: f32) -> f32 {
    let sin = sqrt(max(1.0 - cos * cos, 0.0));
    return select(cos * map.turn.x - sin * map.turn.y, -1.0, cos <= -map.turn.x);
}

// A transformed cluster, which must not be empty. Twin of `Cluster::transformed`.
fn cluster_transformed(cluster: LightCluster, map: Linear, flux: f32) -> LightCluster {
    let center = 0.5 * (cluster.box_min + cluster.box_max);
    let half = max(cluster.box_max - center, center - cluster.box_min);
    let moved_center = map.x * center.x + map.y * center.y + map.z * center.z + map.translation;
    let reach = abs(map.x) * half.x + abs(map.y) * half.y + abs(map.z) * half.z;
    let far = abs(center) + half;
    let size = abs(map.x) * far.x + abs(map.y) * far.y + abs(map.z) * far.z + abs(map.translation);
    let axis = map.area_x * cluster.axis.x + map.area_y * cluster.axis.y + map.area_z * cluster.axis.z;
    var moved: LightCluster;
    moved.mean = map.x * cluster.mean.x + map.y * cluster.mean.y + map.z * cluster.mean.z + map.translation;
    moved.flux = flux;
    moved.box_min = moved_center - (reach + size * TRANSFORM_PADDING);
    moved.variance = cluster.variance * map.mean_square_scale;
    moved.box_max = moved_center + (reach + size * TRANSFORM_PADDING);
    moved.range = cluster.range;
    moved.axis = normalize_or(axis, vec3(0.0)) * length(cluster.axis);
    moved.cos_half_angle = linear_widened(map, linear_widened(map, cluster.cos_half_angle));
    return moved;
}

// Four clusters, one in each component; the columns of matrices are x, y and z. A dark cluster has
// an inverted box.
struct ClusterFour {
    box_min: mat3x4<f32>,
    box_max: mat3x4<f32>,
    mean: mat3x4<f32>,
    axis: mat3x4<f32>,
    flux: vec4<f32>,
    variance: vec4<f32>,
    cos_half_angle: vec4<f32>,
    range: vec4<f32>,
}

// Eight clusters. Twin of `WideCluster`.
struct ClusterEight {
    first: ClusterFour,
    last: ClusterFour,
}

fn cluster_four(a: LightCluster, b: LightCluster, c: LightCluster, d: LightCluster) -> ClusterFour {
    let flux = vec4(a.flux, b.flux, c.flux, d.flux);
    let is_lit = flux > vec4(0.0);
    let box_min = transpose(mat4x3(a.box_min, b.box_min, c.box_min, d.box_min));
    let box_max = transpose(mat4x3(a.box_max, b.box_max, c.box_max, d.box_max));
    let nowhere = vec4(NOWHERE);
    return ClusterFour(
        mat3x4(
            select(nowhere, box_min[0], is_lit),
            select(nowhere, box_min[1], is_lit),
            select(nowhere, box_min[2], is_lit),
        ),
        mat3x4(
            select(-nowhere, box_max[0], is_lit),
            select(-nowhere, box_max[1], is_lit),
            select(-nowhere, box_max[2], is_lit),
        ),
        transpose(mat4x3(a.mean, b.mean, c.mean, d.mean)),
        transpose(mat4x3(a.axis, b.axis, c.axis, d.axis)),
        flux,
        vec4(a.variance, b.variance, c.variance, d.variance),
        vec4(a.cos_half_angle, b.cos_half_angle, c.cos_half_angle, d.cos_half_angle),
        vec4(a.range, b.range, c.range, d.range),
    );
}

// The sum of eight numbers, in the order of `sum` in src/tree/wide.rs.
fn sum_of_eight(first: vec4<f32>, last: vec4<f32>) -> f32 {
    let pairs = first + last;
    return (pairs.x + pairs.z) + (pairs.y + pairs.w);
}

fn min_of_eight(first: vec4<f32>, last: vec4<f32>) -> f32 {
    let lower = min(first, last);
    return min(min(lower.x, lower.y), min(lower.z, lower.w));
}

fn max_of_eight(first: vec4<f32>, last: vec4<f32>) -> f32 {
    let upper = max(first, last);
    return max(max(upper.x, upper.y), max(upper.z, upper.w));
}

// For each cluster, the cosine of the cap around a unit vector (a row of `units`) that holds the
// cluster's cap; 1 for a dark cluster. Twin of `cap_about` in src/cone.rs.
fn cap_about(units: mat3x4<f32>, four: ClusterFour) -> vec4<f32> {
    let axis = four.axis;
    let length = sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    let inverse = 1.0 / select(vec4(1.0), length, length > vec4(0.0));
    let x = axis[0] * inverse;
    let y = axis[1] * inverse;
    let z = axis[2] * inverse;
    let cos = units[0] * x + units[1] * y + units[2] * z;
    let cross_x = units[1] * z - units[2] * y;
    let cross_y = units[2] * x - units[0] * z;
    let cross_z = units[0] * y - units[1] * x;
    let sin = sqrt(cross_x * cross_x + cross_y * cross_y + cross_z * cross_z);
    let cos_half = four.cos_half_angle;
    let sin_half = sqrt(max(1.0 - cos_half * cos_half, vec4(0.0)));
    let reach = cos * cos_half - sin * sin_half - CAP_PADDING;
    let is_beyond = sin * cos_half + cos * sin_half < vec4(0.0);
    let is_all = is_beyond | (cos_half <= vec4(-1.0)) | (reach < vec4(-1.0));
    return select(vec4(1.0), select(reach, vec4(-1.0), is_all), four.flux > vec4(0.0));
}

// The cluster of eight clusters. Twin of `WideCluster::merged`.
fn cluster_merged(eight: ClusterEight) -> LightCluster {
    let a = eight.first;
    let b = eight.last;
    let total = sum_of_eight(a.flux, b.flux);
    if total <= 0.0 {
        return CLUSTER_EMPTY;
    }
    let share_a = a.flux * (1.0 / total);
    let share_b = b.flux * (1.0 / total);
    var merged: LightCluster;
    merged.flux = min(total, LIGHT_MAX_FLUX);
    merged.box_min = vec3(
        min_of_eight(a.box_min[0], b.box_min[0]),
        min_of_eight(a.box_min[1], b.box_min[1]),
        min_of_eight(a.box_min[2], b.box_min[2]),
    );
    merged.box_max = vec3(
        max_of_eight(a.box_max[0], b.box_max[0]),
        max_of_eight(a.box_max[1], b.box_max[1]),
        max_of_eight(a.box_max[2], b.box_max[2]),
    );
    let middle = 0.5 * (merged.box_min + merged.box_max);
    merged.mean = middle + vec3(
        sum_of_eight(share_a * (a.mean[0] - middle.x), share_b * (b.mean[0] - middle.x)),
        sum_of_eight(share_a * (a.mean[1] - middle.y), share_b * (b.mean[1] - middle.y)),
        sum_of_eight(share_a * (a.mean[2] - middle.z), share_b * (b.mean[2] - middle.z)),
    );
    let between = sum_of_eight(share_a * dist_sq(a.mean, merged.mean), share_b * dist_sq(b.mean, merged.mean));
    merged.variance = between + sum_of_eight(share_a * a.variance, share_b * b.variance);
    merged.range = max_of_eight(a.range, b.range);
    merged.axis = vec3(
        sum_of_eight(share_a * a.axis[0], share_b * b.axis[0]),
        sum_of_eight(share_a * a.axis[1], share_b * b.axis[1]),
        sum_of_eight(share_a * a.axis[2], share_b * b.axis[2]),
    );
    let length = length(merged.axis);
    merged.cos_half_angle = -1.0;
    if length <= MIN_AXIS {
        merged.axis = vec3(0.0);
    } else {
        let unit = merged.axis / length;
        let units = mat3x4(vec4(unit.x), vec4(unit.y), vec4(unit.z));
        merged.cos_half_angle = min_of_eight(cap_about(units, a), cap_about(units, b));
    }
    return merged;
}

// The squared distances of four means from a point.
fn dist_sq(means: mat3x4<f32>, mean: vec3<f32>) -> vec4<f32> {
    let x = means[0] - mean.x;
    let y = means[1] - mean.y;
    let z = means[2] - mean.z;
    return x * x + y * y + z * z;
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

// Four whole numbers as bytes. Rounding may have moved them out of a byte's range, so they are
// clamped.
fn pack_bytes(v: vec4<f32>) -> u32 {
    let bytes = vec4<u32>(clamp(v, vec4(0.0), vec4(LIGHT_STEPS))) << vec4(0u, 8u, 16u, 24u);
    return bytes.x | bytes.y | bytes.z | bytes.w;
}

// Four whole numbers from -128 to 127 as bytes.
fn pack_signed_bytes(v: vec4<f32>) -> u32 {
    let bytes = (bitcast<vec4<u32>>(vec4<i32>(v)) & vec4(0xffu)) << vec4(0u, 8u, 16u, 24u);
    return bytes.x | bytes.y | bytes.z | bytes.w;
}

// The upper halves of four floats. `rounding` is added to their bits first: 0x8000 rounds to
// nearest, 0xffff rounds up.
fn pack_halves(v: vec4<f32>, rounding: u32) -> vec2<u32> {
    let bits = (bitcast<vec4<u32>>(v) + vec4(rounding)) >> vec4(16u);
    return vec2(bits.x | (bits.y << 16u), bits.z | (bits.w << 16u));
}

// The boxes and means of four clusters along one axis.
struct PackedAxis {
    low: u32,
    high: u32,
    mean: u32,
    // The sizes of the unpacked boxes.
    size: vec4<f32>,
}

// Packs four clusters along one axis; `bits` is the exponent of the grid's step.
fn pack_axis(
    origin: f32,
    bits: u32,
    box_min: vec4<f32>,
    box_max: vec4<f32>,
    mean: vec4<f32>,
    is_lit: vec4<bool>,
) -> PackedAxis {
    let step = bitcast<f32>(bits << 23u);
    // The inverse of a power of two from its exponent is exact, while a division may not be.
    let per_step = select(0.0, bitcast<f32>((254u - bits) << 23u), bits > 0u);
    let lower = select(vec4(origin), box_min, is_lit);
    let upper = select(vec4(origin), box_max, is_lit);
    // The unpacked box must hold the box, so a corner that was rounded inward moves by one more
    // step.
    var low = round((lower - origin) * per_step);
    low -= select(vec4(0.0), vec4(1.0), origin + low * step > lower);
    var high = round((upper - origin) * per_step);
    high += select(vec4(0.0), vec4(1.0), origin + high * step < upper);
    let start = origin + low * step;
    let size = (origin + high * step) - start;
    let share = (mean - start) / select(vec4(1.0), size, size > vec4(0.0));
    let steps = select(vec4(0.0), trunc(share * LIGHT_STEPS + 0.5), is_lit);
    return PackedAxis(pack_bytes(low), pack_bytes(high), pack_bytes(steps), size);
}

// Rounds to the nearest whole numbers, halves away from zero.
fn rounded_signed(v: vec4<f32>) -> vec4<f32> {
    return trunc(v + select(vec4(0.5), vec4(-0.5), v < vec4(0.0)));
}

// Four packed children: the bytes of each property in a word, and halves in two.
struct PackedFour {
    low: vec3<u32>,
    high: vec3<u32>,
    mean: vec3<u32>,
    deviation: u32,
    flux: vec2<u32>,
    shortness: u32,
    axis: vec3<u32>,
    cap: u32,
    range: vec2<u32>,
}

// Packs four clusters into a node with this origin and these exponents of its steps.
fn pack_four(four: ClusterFour, origin: vec3<f32>, bits: vec3<u32>) -> PackedFour {
    let is_lit = four.flux > vec4(0.0);
    let x = pack_axis(origin.x, bits.x, four.box_min[0], four.box_max[0], four.mean[0], is_lit);
    let y = pack_axis(origin.y, bits.y, four.box_min[1], four.box_max[1], four.mean[1], is_lit);
    let z = pack_axis(origin.z, bits.z, four.box_min[2], four.box_max[2], four.mean[2], is_lit);
    let half_diagonal_sq = 0.25 * x.size * x.size + 0.25 * y.size * y.size + 0.25 * z.size * z.size;
    let ratio_sq = four.variance / select(vec4(1.0), half_diagonal_sq, half_diagonal_sq > vec4(0.0));

    let length = sqrt(four.axis[0] * four.axis[0] + four.axis[1] * four.axis[1] + four.axis[2] * four.axis[2]);
    let has_axis = is_lit & (length > vec4(0.0));
    let to_steps = LIGHT_DIRECTION_STEPS / select(vec4(1.0), length, has_axis);
    let axis_x = select(vec4(0.0), rounded_signed(four.axis[0] * to_steps), has_axis);
    let axis_y = select(vec4(0.0), rounded_signed(four.axis[1] * to_steps), has_axis);
    let axis_z = select(vec4(LIGHT_DIRECTION_STEPS), rounded_signed(four.axis[2] * to_steps), has_axis);
    let inverse = 1.0 / sqrt(axis_x * axis_x + axis_y * axis_y + axis_z * axis_z);
    let caps = cap_about(mat3x4(axis_x * inverse, axis_y * inverse, axis_z * inverse), four);

    return PackedFour(
        vec3(x.low, y.low, z.low),
        vec3(x.high, y.high, z.high),
        vec3(x.mean, y.mean, z.mean),
        pack_bytes(trunc(sqrt(ratio_sq) * LIGHT_STEPS + 0.5)),
        pack_halves(four.flux, 0x8000u),
        pack_bytes(trunc(sqrt(1.0 - select(vec4(0.0), min(length, vec4(1.0)), is_lit)) * LIGHT_STEPS + 0.5)),
        vec3(pack_signed_bytes(axis_x), pack_signed_bytes(axis_y), pack_signed_bytes(axis_z)),
        pack_bytes(select(vec4(2.0 * LIGHT_CAP_STEPS), ceil((1.0 - caps) * LIGHT_CAP_STEPS), is_lit)),
        pack_halves(select(vec4(LIGHT_UNLIMITED_RANGE), min(four.range, vec4(LIGHT_UNLIMITED_RANGE)), is_lit), 0xffffu),
    );
}

// Packs a node from eight clusters and their merged cluster. Twin of `Node::pack`. Targets and
// parent are zero. Dark clusters get the values of lights without a cone and without a range.
fn node_packed(eight: ClusterEight, merged: LightCluster) -> LightNode {
    let bits = vec3(
        step_bits(merged.box_min.x, merged.box_max.x),
        step_bits(merged.box_min.y, merged.box_max.y),
        step_bits(merged.box_min.z, merged.box_max.z),
    );
    let a = pack_four(eight.first, merged.box_min, bits);
    let b = pack_four(eight.last, merged.box_min, bits);
    var node: LightNode;
    node.head = vec4(
        bitcast<vec3<u32>>(merged.box_min),
        (LIGHT_WIDTH << 24u) | bits.x | (bits.y << 8u) | (bits.z << 16u),
    );
    node.children = array(
        packed_child(a, 0u), packed_child(a, 1u), packed_child(a, 2u), packed_child(a, 3u),
        packed_child(b, 0u), packed_child(b, 1u), packed_child(b, 2u), packed_child(b, 3u),
    );
    node.lobes = array(
        vec4(packed_lobe(a, 0u), packed_lobe(a, 1u)), vec4(packed_lobe(a, 2u), packed_lobe(a, 3u)),
        vec4(packed_lobe(b, 0u), packed_lobe(b, 1u)), vec4(packed_lobe(b, 2u), packed_lobe(b, 3u)),
    );
    return node;
}

// A byte of a word, in its lowest byte.
fn packed_byte(word: u32, lane: u32) -> u32 {
    return (word >> (8u * lane)) & 0xffu;
}

// A half of two words, in its lower half.
fn packed_half(words: vec2<u32>, lane: u32) -> u32 {
    return (select(words.x, words.y, lane >= 2u) >> (16u * (lane & 1u))) & 0xffffu;
}

// One of four children without its target, as a node stores it: see LightPackedChild.
fn packed_child(four: PackedFour, lane: u32) -> vec4<u32> {
    let low = packed_byte(four.low.x, lane) | (packed_byte(four.low.y, lane) << 8u)
        | (packed_byte(four.low.z, lane) << 16u) | (packed_byte(four.deviation, lane) << 24u);
    let high = packed_byte(four.high.x, lane) | (packed_byte(four.high.y, lane) << 8u)
        | (packed_byte(four.high.z, lane) << 16u) | (packed_byte(four.mean.x, lane) << 24u);
    let mean = packed_byte(four.mean.y, lane) | (packed_byte(four.mean.z, lane) << 8u)
        | (packed_half(four.flux, lane) << 16u);
    return vec4(0u, low, high, mean);
}

fn packed_lobe(four: PackedFour, lane: u32) -> vec2<u32> {
    let axis = packed_byte(four.axis.x, lane) | (packed_byte(four.axis.y, lane) << 8u)
        | (packed_byte(four.axis.z, lane) << 16u) | (packed_byte(four.cap, lane) << 24u);
    return vec2(axis, packed_byte(four.shortness, lane) | (packed_half(four.range, lane) << 16u));
}

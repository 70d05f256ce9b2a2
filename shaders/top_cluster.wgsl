// What a node of the top level knows of the lights below it: merging, moving and packing. Binds nothing.
// Twin of src/cluster.rs, src/cone.rs and `Child::pack`; tests in src/gpu/top.rs compare both.
//
// Differs from the twin: a cone is kept as cosine and sine of *half* its half-angle. Sums of angles are then products
// of complex numbers, exact to a few ulp everywhere, while WGSL lets sin and cos be off by 5e-4 and atan2 by 4096 ulp,
// which no padding would cover.

struct Cone {
    axis: vec3<f32>,
    // Cosine and sine of half the half-angle: (1, 0) is one direction, (0, 1) all of them, (0, 0) none.
    half: vec2<f32>,
}

struct Cluster {
    box_min: vec3<f32>,
    box_max: vec3<f32>,
    cone: Cone,
    flux: f32,
    mean: vec3<f32>,
    variance: f32,
    axis: vec3<f32>,
    range: f32,
}

const CONE_NONE = vec2(0.0, 0.0);
const CONE_ALL = vec2(0.0, 1.0);

// WGSL has no infinity; no box reaches farther.
const NOWHERE: f32 = 3.4e38;

const CHILD_EMPTY = LightChild(vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(0.0), 0.0, 0u, 0u, 0u, LIGHT_EMPTY_SLOT);

fn cluster_empty(mean: vec3<f32>) -> Cluster {
    let cone = Cone(vec3(0.0, 0.0, 1.0), CONE_NONE);
    return Cluster(vec3(NOWHERE), vec3(-NOWHERE), cone, 0.0, mean, 0.0, vec3(0.0), 0.0);
}

// Length without squares that overflow: areas grow with the square of a scale, and this is asked of areas.
fn safe_length(v: vec3<f32>) -> f32 {
    let largest = max(abs(v.x), max(abs(v.y), abs(v.z)));
    if largest <= 0.0 {
        return 0.0;
    }
    return largest * length(v / largest);
}

fn normalize_or(v: vec3<f32>, other: vec3<f32>) -> vec3<f32> {
    let largest = max(abs(v.x), max(abs(v.y), abs(v.z)));
    if largest <= 0.0 {
        return other;
    }
    return normalize(v / largest);
}

// Some unit vector at a right angle to a unit vector.
fn perpendicular(d: vec3<f32>) -> vec3<f32> {
    var axis = vec3(0.0, 0.0, 1.0);
    if abs(d.x) <= abs(d.y) && abs(d.x) <= abs(d.z) {
        axis = vec3(1.0, 0.0, 0.0);
    } else if abs(d.y) <= abs(d.z) {
        axis = vec3(0.0, 1.0, 0.0);
    }
    return normalize(cross(d, axis));
}

fn complex_mul(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return vec2(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
}

// Cosine and sine of half an angle in [0, pi]. Each branch takes the root of a sum that does not cancel.
fn half_of(angle: vec2<f32>) -> vec2<f32> {
    if angle.x >= 0.0 {
        let c = sqrt(0.5 + 0.5 * angle.x);
        return vec2(c, 0.5 * angle.y / c);
    }
    let s = sqrt(0.5 - 0.5 * angle.x);
    return vec2(0.5 * angle.y / s, s);
}

// A little wider, for angles far below 1e-3: cosine and sine of angle + padding.
fn padded(angle: vec2<f32>, padding: f32) -> vec2<f32> {
    return normalize(vec2(angle.x - angle.y * padding, angle.y + angle.x * padding));
}

fn cone_union(first: Cone, second: Cone) -> Cone {
    var a = first;
    var b = second;
    if all(a.half == CONE_NONE) || (b.half.y > a.half.y && any(b.half != CONE_NONE)) {
        a = second;
        b = first;
    }
    if all(b.half == CONE_NONE) || a.half.x <= 0.0 {
        return a;
    }
    // Half the angle between the axes, accurate everywhere (Kahan 2006).
    let between = normalize(vec2(length(a.axis + b.axis), length(a.axis - b.axis)));
    let far_side = complex_mul(between, b.half);
    // Half of what a's half-angle has left over: from -pi to pi / 2. Its sine keeps the digits of narrow cones.
    let left = complex_mul(a.half, vec2(far_side.x, -far_side.y));
    if left.y >= 0.0 && left.x >= 0.0 {
        return a;
    }
    // The union's half-angle: up to 3 pi / 2, and beyond pi where its sine is negative.
    let angle = padded(complex_mul(far_side, a.half), UNION_PADDING);
    if angle.y <= 0.0 {
        return Cone(a.axis, CONE_ALL);
    }
    // Turn a's axis towards b's, in the plane of both; any plane will do when they are opposite.
    var toward = b.axis - a.axis * dot(a.axis, b.axis);
    if dot(toward, toward) > 1.0e-12 {
        toward = normalize(toward);
    } else {
        toward = perpendicular(a.axis);
    }
    return Cone(normalize(a.axis * left.x - toward * left.y), half_of(angle));
}

// Twin of `Cluster::merge`.
fn cluster_merge(a: Cluster, b: Cluster) -> Cluster {
    let flux = a.flux + b.flux;
    var share = 0.0;
    if flux > 0.0 {
        share = b.flux / flux;
    }
    let apart = b.mean - a.mean;
    var both: Cluster;
    both.box_min = min(a.box_min, b.box_min);
    both.box_max = max(a.box_max, b.box_max);
    both.cone = cone_union(a.cone, b.cone);
    both.flux = min(flux, LIGHT_MOST_FLUX);
    both.mean = select(a.mean + apart * share, b.mean, share == 1.0);
    both.variance = (1.0 - share) * a.variance + share * b.variance + share * (1.0 - share) * dot(apart, apart);
    both.axis = a.axis * (1.0 - share) + b.axis * share;
    both.range = max(a.range, b.range);
    return both;
}

// Twin of `Linear`.
struct Linear {
    x: vec3<f32>,
    y: vec3<f32>,
    z: vec3<f32>,
    translation: vec3<f32>,
    // The matrix of cofactors, its sign changed for mirrors.
    area_x: vec3<f32>,
    area_y: vec3<f32>,
    area_z: vec3<f32>,
    keeps_angles: bool,
    mean_square_scale: f32,
}

fn linear_of(instance: LightInstance) -> Linear {
    let rows = instance.to_world;
    let x = vec3(rows[0].x, rows[1].x, rows[2].x);
    let y = vec3(rows[0].y, rows[1].y, rows[2].y);
    let z = vec3(rows[0].z, rows[1].z, rows[2].z);
    let mirrored = select(1.0, -1.0, instance.to_local[0].w < 0.0);
    return Linear(
        x, y, z, vec3(rows[0].w, rows[1].w, rows[2].w),
        cross(y, z) * mirrored, cross(z, x) * mirrored, cross(x, y) * mirrored,
        (instance.flags & LIGHT_KEEPS_ANGLES) != 0u, instance.to_local[2].w,
    );
}

// Twin of `Linear::flux`.
fn linear_flux(map: Linear, punctual: f32, area: f32, axis: vec3<f32>) -> f32 {
    let lengths = vec3(safe_length(map.area_x), safe_length(map.area_y), safe_length(map.area_z));
    let all_sides = safe_length(lengths) * sqrt(1.0 / 3.0);
    let agreement = min(1.5 * length(axis), 1.0);
    let normal = normalize_or(axis, vec3(0.0));
    let along = safe_length(map.area_x * normal.x + map.area_y * normal.y + map.area_z * normal.z);
    return min(punctual + area * (agreement * along + (1.0 - agreement) * all_sides), LIGHT_MOST_FLUX);
}

// Twin of `Cluster::transformed`; the cluster is not empty.
fn cluster_transformed(cluster: Cluster, map: Linear, flux: f32) -> Cluster {
    var moved = cluster;
    let center = 0.5 * (cluster.box_min + cluster.box_max);
    let half = max(cluster.box_max - center, center - cluster.box_min);
    let moved_center = map.x * center.x + map.y * center.y + map.z * center.z + map.translation;
    let reach = abs(map.x) * half.x + abs(map.y) * half.y + abs(map.z) * half.z;
    let far = abs(center) + half;
    let size = abs(map.x) * far.x + abs(map.y) * far.y + abs(map.z) * far.z + abs(map.translation);
    moved.box_min = moved_center - (reach + size * TRANSFORM_PADDING);
    moved.box_max = moved_center + (reach + size * TRANSFORM_PADDING);
    let axis = cluster.cone.axis;
    if !map.keeps_angles {
        moved.cone.half = CONE_ALL;
    } else if cluster.cone.half.x > 0.0 {
        moved.cone.axis = normalize_or(map.x * axis.x + map.y * axis.y + map.z * axis.z, axis);
    }
    moved.flux = flux;
    moved.mean = map.x * cluster.mean.x + map.y * cluster.mean.y + map.z * cluster.mean.z + map.translation;
    moved.variance = cluster.variance * map.mean_square_scale;
    let lobe = map.area_x * cluster.axis.x + map.area_y * cluster.axis.y + map.area_z * cluster.axis.z;
    moved.axis = normalize_or(lobe, vec3(0.0)) * length(cluster.axis);
    return moved;
}

// Twin of `Child::cluster`.
fn child_cluster(child: LightChild) -> Cluster {
    if child.flux <= 0.0 {
        return cluster_empty(child.mean);
    }
    let cos_half_angle = light_cos_half_angle(child);
    var cone = Cone(vec3(0.0, 0.0, 1.0), CONE_ALL);
    if cos_half_angle > -1.0 {
        let half = sqrt(vec2(0.5 + 0.5 * cos_half_angle, 0.5 - 0.5 * cos_half_angle));
        cone = Cone(light_unpack_direction(child.cone_axis), half);
    }
    let axis = light_unpack_direction(child.lobe_axis) * light_lobe_length(child);
    return Cluster(child.box_min, child.box_max, cone, child.flux, child.mean, child.variance, axis, child.range);
}

// Twin of `pack_direction`.
fn pack_direction(d: vec3<f32>) -> u32 {
    let flat = d / (abs(d.x) + abs(d.y) + abs(d.z));
    var oct = flat.xy;
    if flat.z < 0.0 {
        oct = (vec2(1.0) - abs(flat.yx)) * select(vec2(-1.0), vec2(1.0), flat.xy >= vec2(0.0));
    }
    let steps = vec2<i32>(floor(clamp(oct, vec2(-1.0), vec2(1.0)) * SNORM + 0.5));
    return (bitcast<u32>(steps.x) & 0xffffu) | (bitcast<u32>(steps.y) << 16u);
}

// Twin of `Child::pack`.
fn child_pack(cluster: Cluster, target_bits: u32) -> LightChild {
    var child = CHILD_EMPTY;
    child.mean = cluster.mean;
    child.target_bits = target_bits;
    if cluster.flux <= 0.0 {
        return child;
    }
    child.flux = cluster.flux;
    child.box_min = cluster.box_min;
    child.variance = cluster.variance;
    child.box_max = cluster.box_max;
    child.range = min(cluster.range, LIGHT_FARTHEST);
    child.lobe_axis = pack_direction(normalize_or(cluster.axis, vec3(0.0, 0.0, 1.0)));
    child.cone_axis = pack_direction(cluster.cone.axis);
    let angle = padded(complex_mul(cluster.cone.half, cluster.cone.half), CONE_PADDING);
    let cos_half_angle = select(angle.x, -1.0, cluster.cone.half.x <= 0.0 || angle.y <= 0.0);
    let steps = i32(max(floor(cos_half_angle * SNORM - COSINE_ROUNDING), -SNORM));
    child.angles = u32(min(length(cluster.axis), 1.0) * UNORM + 0.5) | (bitcast<u32>(steps) << 16u);
    return child;
}

// What light is sampled for. Twin of src/shading/shading_point.rs. Binds nothing.

struct LightShadingPoint {
    // Metres, relative to the world's origin.
    position: vec3<f32>,
    // Unit normal of the side that light arrives at; zero for a point in a volume.
    normal: vec3<f32>,
    // #if GLOSSY
    gloss: LightGloss,
    // What the key of its cell holds of the gloss; LIGHT_NO_CELL for a point that shares no cell.
    cell_gloss: u32,
    // #endif
    // #if SEGMENTS
    // From the start of a segment to its end, in metres; the position is its middle. Zero for a
    // point.
    segment: vec3<f32>,
    // #endif
    // #if MASKS
    // Only lights of instances whose mask has a bit in common with this one reach the point.
    mask: u32,
    // #endif
}

// Limits coordinates to LIGHT_UNLIMITED_RANGE, which NaN becomes too. The coordinates of every
// shading point pass through here, so no other function meets a NaN from outside. Limits bits,
// because a compiler may assume that a float is no NaN, and drop comparisons that would tell.
fn light_limited(v: vec3<f32>) -> vec3<f32> {
    let bits = bitcast<vec3<u32>>(v);
    let limited = min(bits & vec3(0x7fffffffu), vec3(LIGHT_FARTHEST_BITS));
    return bitcast<vec3<f32>>((bits & vec3(0x80000000u)) | limited);
}

// A point on a surface; `normal` is a unit vector that points to the side that is shaded.
fn light_surface_point(position: vec3<f32>, normal: vec3<f32>) -> LightShadingPoint {
    var shading_point: LightShadingPoint;
    shading_point.position = light_limited(position);
    shading_point.normal = light_limited(normal);
    // #if MASKS
    shading_point.mask = 0xffffffffu;
    // #endif
    return shading_point;
}

// The same point with another mask; all bits are set in that of other points. Twin of
// `ShadingPoint::with_mask`. Returns the point as it is in shaders without MASKS.
fn light_masked_point(shading_point: LightShadingPoint, mask: u32) -> LightShadingPoint {
    var masked = shading_point;
    // #if MASKS
    masked.mask = mask;
    // #endif
    return masked;
}

// A point on a glossy surface. `view` points to the viewer, and the other arguments are the fields
// of `Gloss` in src/shading/gloss.rs. The same as light_surface_point in shaders without GLOSSY.
fn light_glossy_point(
    position: vec3<f32>, normal: vec3<f32>, view: vec3<f32>, roughness: f32, specular: f32, diffuse: f32,
) -> LightShadingPoint {
    var shading_point = light_surface_point(position, normal);
    // #if GLOSSY
    shading_point.gloss = light_gloss(
        light_normalize_or_zero(shading_point.normal), light_limited(view), roughness, specular, diffuse,
    );
    shading_point.cell_gloss = light_cell_gloss(shading_point, light_limited(view), roughness, specular, diffuse);
    // #endif
    return shading_point;
}

// A point in a volume, where light arrives from all sides.
fn light_volume_point(position: vec3<f32>) -> LightShadingPoint {
    return light_surface_point(position, vec3(0.0));
}

// The segment origin + t * direction of a ray through a volume, for t from 0 to `length`. Twin of
// `ShadingPoint::segment`. The point in its middle in shaders without SEGMENTS.
fn light_segment(origin: vec3<f32>, direction: vec3<f32>, length: f32) -> LightShadingPoint {
    // A vector that is limited is too long for a segment.
    let segment = light_limited(direction * length);
    let length_sq = dot(segment, segment);
    let is_segment = length_sq >= LIGHT_MIN_SEGMENT_SQ && length_sq <= LIGHT_MAX_SEGMENT_SQ;
    var shading_point = light_volume_point(select(origin, origin + 0.5 * segment, is_segment));
    // #if SEGMENTS
    shading_point.segment = select(vec3(0.0), segment, is_segment);
    // #endif
    return shading_point;
}

fn light_normalize_or_zero(v: vec3<f32>) -> vec3<f32> {
    let length_sq = dot(v, v);
    if length_sq > 0.0 {
        return v / sqrt(length_sq);
    }
    return vec3(0.0);
}

// #if SEGMENTS
// Whether a shading point is a segment.
fn light_is_segment(shading_point: LightShadingPoint) -> bool {
    let length_sq = dot(shading_point.segment, shading_point.segment);
    return length_sq >= LIGHT_MIN_SEGMENT_SQ && length_sq <= LIGHT_MAX_SEGMENT_SQ
        && all(light_normalize_or_zero(shading_point.normal) == vec3(0.0));
}
// #endif

// The side of a cube that a normal points through; 6 for a point in a volume. Twin of `side`.
fn light_side(normal: vec3<f32>) -> u32 {
    let size = abs(normal);
    var axis = 2u;
    if size.x >= size.y && size.x >= size.z {
        axis = 0u;
    } else if size.y >= size.z {
        axis = 1u;
    }
    return select(2u * axis + select(0u, 1u, normal[axis] < 0.0), 6u, all(normal == vec3(0.0)));
}

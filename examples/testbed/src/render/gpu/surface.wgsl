// The scene, camera rays, and the surfaces that they meet: what the shaders that render and that mark the
// cells of shared cuts have in common.
//
// The library's text (group 1) precedes this file. `pipeline.rs` defines `STACK_SIZE` and `TEXEL_ROW`. The
// nodes are twins of those of `nodes.rs`, and `trace` of that of `rays.rs`.

struct Frame {
    eye: vec3<f32>,
    width: u32,
    // Half the width, and below half the height, of the picture at a distance of 1.
    right: vec3<f32>,
    height: u32,
    up: vec3<f32>,
    seed: u32,
    forward: vec3<f32>,
    lamp_clearance: f32,
    zenith: vec3<f32>,
    top_root: u32,
    horizon: vec3<f32>,
    // The records before it are materials and textures.
    first_object: u32,
    ambient: vec3<f32>,
    candidates: u32,
    // The box of everything that casts shadows.
    occluder_min: vec3<f32>,
    // The random numbers' `block_bits` and `tile_bits`.
    block_bits: u32,
    occluder_max: vec3<f32>,
    tile_bits: u32,
    // The samples [begin, end) and the rows [begin, end) of this dispatch.
    sample_begin: u32,
    sample_end: u32,
    row_begin: u32,
    row_end: u32,
    haze: f32,
    // The triangles from it on are attributes.
    first_attribute: u32,
    // The number of samples whose luminance is summed up for the estimate of the error.
    first_half: u32,
    // 1 if samples are spread over the pixel and over lights. 0 if all pass through its middle and take
    // the same points on lights, so that their mean estimates a sum that has no integral.
    is_spread: u32,
    // The radiance that shows as white, in nits.
    white: f32,
    // The draws that a kept light stands for, at most; 0 if the last frame has kept none.
    kept_draws: f32,
    // The first of the records of pixels that this frame keeps, and of those of the last one.
    kept_first: u32,
    kept_first_then: u32,
    // Of the sky around the sun.
    glow: vec3<f32>,
    sun: vec3<f32>,
    // The camera of the last frame.
    eye_then: vec3<f32>,
    right_then: vec3<f32>,
    up_then: vec3<f32>,
    forward_then: vec3<f32>,
    // The scene of the last frame: the first of its nodes and of its objects, and its occluders.
    top_root_then: u32,
    occluder_min_then: vec3<f32>,
    top_first_then: u32,
    occluder_max_then: vec3<f32>,
    first_object_then: u32,
}

struct Node {
    min0: vec3<f32>,
    child0: u32,
    max0: vec3<f32>,
    padding0: u32,
    min1: vec3<f32>,
    child1: u32,
    max1: vec3<f32>,
    padding1: u32,
}

struct Triangle {
    corner: vec3<f32>,
    material: u32,
    edge1: vec3<f32>,
    flags: u32,
    edge2: vec3<f32>,
    attributes: u32,
}

// A material (base color and roughness; emission and metallic; opacity, cutoff and unlit; flags, and the
// records of the textures of base color, emission and roughness, 0 for none), a texture (rows of the
// transform; zero; first texel, size, flags, 0) or an object (rows of world to mesh; root, bits of the
// emission scale, 0, 0). They share a buffer, since WebGPU guarantees only eight.
struct Record {
    row0: vec4<f32>,
    row1: vec4<f32>,
    row2: vec4<f32>,
    words: vec4<u32>,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> triangles: array<Triangle>;
@group(0) @binding(3) var<storage, read> records: array<Record>;
@group(0) @binding(4) var<storage, read_write> image: array<vec4<f32>>;
// The texels of all images, one after the other, in rows of TEXEL_ROW texels and layers of as many
// rows.
@group(0) @binding(5) var texels: texture_2d_array<u32>;

const PI: f32 = 3.14159265358979;
const LEAF: u32 = 0x80000000u;
const NOTHING: u32 = 0xffffffffu;
const LEAVE: u32 = 0xfffffffeu;
const FIRST_MASK: u32 = 0x0fffffffu;
const SEE_THROUGH: u32 = 1u;
const FAR: f32 = 3.0e38;
const SLAB_ROUNDING: f32 = 1.0000004;

struct Hit {
    dist: f32,
    object: u32,
    triangle: u32,
    // Of the second and the third corner.
    weights: vec2<f32>,
}

// A large number where a component is zero: infinity would give 0 * infinity for an origin on a
// side of a box.
fn safe_inverse(v: vec3<f32>) -> vec3<f32> {
    return select(1.0 / v, select(vec3<f32>(1e20), vec3<f32>(-1e20), v < vec3<f32>(0.0)), abs(v) < vec3<f32>(1e-20));
}

// The distance at which a ray enters a box, or FAR.
fn enter_box(low: vec3<f32>, high: vec3<f32>, origin: vec3<f32>, inverse: vec3<f32>, limit: f32) -> f32 {
    let t0 = (low - origin) * inverse;
    let t1 = (high - origin) * inverse;
    let near3 = min(t0, t1);
    let far3 = max(t0, t1);
    let near = max(max(near3.x, near3.y), max(near3.z, 0.0));
    let far = min(min(far3.x, min(far3.y, far3.z)) * SLAB_ROUNDING, limit);
    return select(FAR, near, near <= far);
}

// The share of the light that the translucent surfaces that a shadow ray met let through.
var<private> transmittance: f32;

// Whether rays meet the scene of the last frame.
var<private> is_then: bool;

// The nearest hit of a camera ray, or any hit of a shadow ray that stops the light that is left. `seed`
// is that of a camera ray's decisions at translucent surfaces.
fn trace(world_origin: vec3<f32>, world_direction: vec3<f32>, limit: f32, is_shadow: bool, seed: vec2<u32>) -> Hit {
    var hit = Hit(limit, NOTHING, 0u, vec2<f32>(0.0));
    transmittance = 1.0;
    // NOTHING ends the traversal, LEAVE the traversal of an object.
    var stack: array<u32, STACK_SIZE>;
    stack[0] = NOTHING;
    var height = 1u;
    var object = NOTHING;
    var origin = world_origin;
    var direction = world_direction;
    var inverse = safe_inverse(direction);
    var reference = select(frame.top_root, frame.top_root_then, is_then);
    let top_first = select(0u, frame.top_first_then, is_then);
    let first_object = select(frame.first_object, frame.first_object_then, is_then);
    // The upper hierarchy has references of its own.
    var first_node = top_first;
    loop {
        // All invocations of a wave test boxes until each has reached a leaf, so that boxes and
        // triangles do not mix.
        while (reference & LEAF) == 0u {
            let node = nodes[first_node + reference];
            let enter0 = enter_box(node.min0, node.max0, origin, inverse, hit.dist);
            let enter1 = enter_box(node.min1, node.max1, origin, inverse, hit.dist);
            let first_nearer = enter0 <= enter1;
            if max(enter0, enter1) < FAR {
                stack[height] = select(node.child0, node.child1, first_nearer);
                height += 1u;
            }
            if min(enter0, enter1) < FAR {
                reference = select(node.child1, node.child0, first_nearer);
            } else {
                height -= 1u;
                reference = stack[height];
            }
        }
        if reference == NOTHING {
            break;
        }
        if reference == LEAVE {
            object = NOTHING;
            first_node = top_first;
            origin = world_origin;
            direction = world_direction;
            inverse = safe_inverse(direction);
        } else if object == NOTHING {
            object = reference & FIRST_MASK;
            first_node = 0u;
            let placed = records[first_object + object];
            let origin4 = vec4<f32>(world_origin, 1.0);
            origin = vec3<f32>(dot(placed.row0, origin4), dot(placed.row1, origin4), dot(placed.row2, origin4));
            direction = vec3<f32>(
                dot(placed.row0.xyz, world_direction),
                dot(placed.row1.xyz, world_direction),
                dot(placed.row2.xyz, world_direction),
            );
            inverse = safe_inverse(direction);
            stack[height] = LEAVE;
            height += 1u;
            reference = placed.words.x;
            continue;
        } else {
            let first = reference & FIRST_MASK;
            let end = first + ((reference >> 28u) & 7u) + 1u;
            for (var index = first; index < end; index += 1u) {
                let corner = triangles[index];
                let p = cross(direction, corner.edge2);
                let determinant = dot(corner.edge1, p);
                let scale = 1.0 / select(determinant, 1.0, determinant == 0.0);
                let s = origin - corner.corner;
                let u = dot(s, p) * scale;
                let q = cross(s, corner.edge1);
                let v = dot(direction, q) * scale;
                let t = dot(corner.edge2, q) * scale;
                let inside = determinant != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t < hit.dist;
                if inside && !(is_shadow && (corner.flags & SEE_THROUGH) != 0u) {
                    let weights = vec2<f32>(u, v);
                    if (corner.flags & TRANSLUCENT) != 0u {
                        let covered = coverage(corner, weights);
                        transmittance *= 1.0 - covered;
                        let is_passed = opacity_draw(seed, object, index) >= covered;
                        if select(is_passed, transmittance > 0.0, is_shadow) {
                            continue;
                        }
                    }
                    hit = Hit(t, object, index, weights);
                    if is_shadow {
                        return hit;
                    }
                }
            }
        }
        height -= 1u;
        reference = stack[height];
    }
    return hit;
}

// A point that a camera ray met. The target of candidates needs it.
struct Surface {
    base_color: vec3<f32>,
    roughness: f32,
    normal: vec3<f32>,
    metallic: f32,
    // The unit direction to the camera.
    view: vec3<f32>,
}

fn specular_reflectance(surface: Surface) -> vec3<f32> {
    return mix(vec3<f32>(0.04), surface.base_color, surface.metallic);
}

fn luminance(color: vec3<f32>) -> f32 {
    return dot(color, vec3<f32>(0.2126, 0.7152, 0.0722));
}

// The direction of a camera ray through a pixel.
fn camera_direction(corner: vec2<f32>, jitter: vec2<f32>) -> vec3<f32> {
    let across = (corner + jitter) / vec2<f32>(f32(frame.width), f32(frame.height)) * 2.0 - 1.0;
    return normalize(frame.forward + frame.right * across.x - frame.up * across.y);
}

// A surface as a camera ray meets it.
struct MetSurface {
    surface: Surface,
    // The origin of shadow rays, a little in front of the surface.
    position: vec3<f32>,
    // What it sends to the camera without any light: its emission, and the faint light of the sky.
    emitted: vec3<f32>,
    // Whether it reflects no light.
    is_unlit: bool,
}

// A unit normal in world space: it is transformed by the transpose of the inverse.
fn world_normal(placed: Record, normal: vec3<f32>) -> vec3<f32> {
    return normalize(placed.row0.xyz * normal.x + placed.row1.xyz * normal.y + placed.row2.xyz * normal.z);
}

// The vector from a point of a triangle to the smooth surface that it stands for, in world space. `side`
// is 1 if the front is seen, else -1. Twin of `Geometry::to_smooth_surface` in `rays.rs`.
fn to_smooth_surface(facet: Triangle, weights: vec2<f32>, placed: Record, side: f32) -> vec3<f32> {
    let normals = attribute_corners(facet, NORMALS);
    let place = facet.edge1 * weights.x + facet.edge2 * weights.y;
    let above = side * vec3<f32>(
        dot(place, normals[0].xyz),
        dot(place - facet.edge1, normals[1].xyz),
        dot(place - facet.edge2, normals[2].xyz),
    );
    let all_weights = vec3<f32>(1.0 - weights.x - weights.y, weights);
    let moved = (normals * (all_weights * min(above, vec3<f32>(0.0)) * -side)).xyz;
    // The columns of the inverse.
    let x = cross(placed.row1.xyz, placed.row2.xyz);
    let y = cross(placed.row2.xyz, placed.row0.xyz);
    let z = cross(placed.row0.xyz, placed.row1.xyz);
    let to_smooth = (x * moved.x + y * moved.y + z * moved.z) / dot(placed.row0.xyz, x);
    // Flattened objects may have no inverse.
    return select(vec3<f32>(0.0), to_smooth, all(abs(to_smooth) < vec3<f32>(1e18)));
}

fn met_surface(direction: vec3<f32>, hit: Hit) -> MetSurface {
    let facet = triangles[hit.triangle];
    let placed = records[frame.first_object + hit.object];
    let material = textured(facet, hit.weights);
    let flat_normal = cross(facet.edge1, facet.edge2);
    let front = world_normal(placed, flat_normal);
    let view = -direction;
    let seen_from_front = dot(front, view) >= 0.0;
    let side = select(-1.0, 1.0, seen_from_front);
    var normal = front;
    var to_smooth = vec3<f32>(0.0);
    if (facet.flags & NORMALS) != 0u {
        let smooth_normal = attribute_at(facet, NORMALS, hit.weights).xyz;
        normal = world_normal(placed, select(flat_normal, smooth_normal, any(smooth_normal != vec3<f32>(0.0))));
        to_smooth = to_smooth_surface(facet, hit.weights, placed, side);
    }
    normal *= side;

    var emitted = frame.ambient * material.row0.xyz;
    if seen_from_front || (material.words.x & TWO_SIDED) != 0u {
        emitted += material.row1.xyz * bitcast<f32>(placed.words.y);
    }

    let place = frame.eye + direction * hit.dist;
    let extent = max(max(abs(place.x), abs(place.y)), max(abs(place.z), hit.dist));
    let position = place + to_smooth + front * (side * max(extent, 1.0) * 2e-5);
    let surface = Surface(material.row0.xyz, material.row0.w, normal, material.row1.w, view);
    return MetSurface(surface, position, emitted, material.row2.z > 0.0);
}

fn shading_point(at: MetSurface) -> LightShadingPoint {
    let surface = at.surface;
    return light_glossy_point(
        at.position, surface.normal, surface.view, surface.roughness, luminance(specular_reflectance(surface)),
        luminance(surface.base_color) * (1.0 - surface.metallic),
    );
}

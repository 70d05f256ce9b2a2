// Each invocation renders one pixel: camera ray, nearest hit, several candidates from the library of
// which one is kept, shadow ray, shading.
//
// The library's text (group 1) precedes this file and defines `light_resample_by`. `pipeline.rs`
// defines `STACK_SIZE` and `TEXEL_ROW`. Sky and BRDF are twins of `shading.rs`, the nodes of
// `nodes.rs` and `trace` of `rays.rs`. The test `both_backends_render_the_same_picture` compares
// them.

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
    // The largest number of clusters that a sample splits.
    splits: u32,
    // The radiance that shows as white, in nits.
    white: f32,
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
    var reference = frame.top_root;
    loop {
        // All invocations of a wave test boxes until each has reached a leaf, so that boxes and
        // triangles do not mix.
        while (reference & LEAF) == 0u {
            let node = nodes[reference];
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
            origin = world_origin;
            direction = world_direction;
            inverse = safe_inverse(direction);
        } else if object == NOTHING {
            object = reference & FIRST_MASK;
            let placed = records[frame.first_object + object];
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

fn sky_radiance(direction: vec3<f32>) -> vec3<f32> {
    return mix(frame.horizon, frame.zenith, sqrt(max(direction.y, 0.0)));
}

fn through_haze(radiance: vec3<f32>, dist: f32) -> vec3<f32> {
    let clear = exp(-dist * frame.haze);
    return radiance * clear + frame.horizon * (1.0 - clear);
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

fn brdf(surface: Surface, light: vec3<f32>) -> vec3<f32> {
    let base_color = surface.base_color;
    let roughness = surface.roughness;
    let metallic = surface.metallic;
    let normal = surface.normal;
    let view = surface.view;
    let halfway = normalize(view + light);
    let n_dot_l = max(dot(normal, light), 0.0);
    let n_dot_v = max(dot(normal, view), 1e-4);
    let n_dot_h = dot(normal, halfway);
    let v_dot_h = clamp(dot(view, halfway), 0.0, 1.0);

    let alpha = max(roughness * roughness, 1e-3);
    let alpha_sq = alpha * alpha;
    let n_cross_h = cross(normal, halfway);
    let scaled = n_dot_h * alpha;
    let k = alpha / (dot(n_cross_h, n_cross_h) + scaled * scaled);
    let distribution = k * k / PI;
    let lambda_v = n_dot_l * sqrt(n_dot_v * n_dot_v * (1.0 - alpha_sq) + alpha_sq);
    let lambda_l = n_dot_v * sqrt(n_dot_l * n_dot_l * (1.0 - alpha_sq) + alpha_sq);
    let visibility = 0.5 / max(lambda_v + lambda_l, 1e-12);

    let f0 = specular_reflectance(surface);
    let grazing = 1.0 - v_dot_h;
    let grazing_sq = grazing * grazing;
    let fresnel = f0 + (1.0 - f0) * (grazing_sq * grazing_sq * grazing);
    let diffuse = base_color * ((1.0 - metallic) / PI);
    return (1.0 - fresnel) * diffuse + fresnel * (distribution * visibility);
}

fn luminance(color: vec3<f32>) -> f32 {
    return dot(color, vec3<f32>(0.2126, 0.7152, 0.0722));
}

// The radiance that one point of a light adds if nothing blocks it, not yet divided by a density.
fn reflected(surface: Surface, light: LightSample) -> vec3<f32> {
    let cosine = dot(surface.normal, light.direction);
    if cosine <= 0.0 {
        return vec3<f32>(0.0);
    }
    return brdf(surface, light.direction) * light.radiance * cosine;
}

// The library keeps candidates in proportion to this.
fn reflected_luminance(at: LightShadingPoint, surface: Surface, light: LightSample) -> f32 {
    return luminance(reflected(surface, light));
}

// Whether something may block a ray within a distance. Twin of `Occluders::may_block` in
// `geometry.rs`.
fn may_be_occluded(origin: vec3<f32>, direction: vec3<f32>, limit: f32) -> bool {
    let end = origin + direction * min(limit, FAR);
    return limit > 0.0 && all(min(origin, end) <= frame.occluder_max) && all(max(origin, end) >= frame.occluder_min);
}

// The numbers of shadow rays that this invocation traced, and that it skipped because nothing could
// block them.
var<private> shadow_rays: vec2<f32>;
// The distance of the last hit of a camera ray, or FAR.
var<private> camera_distance: f32;

// The direction of a camera ray through a pixel.
fn camera_direction(corner: vec2<f32>, jitter: vec2<f32>) -> vec3<f32> {
    let across = (corner + jitter) / vec2<f32>(f32(frame.width), f32(frame.height)) * 2.0 - 1.0;
    return normalize(frame.forward + frame.right * across.x - frame.up * across.y);
}

// The numbers by which all samples of a pixel choose points on lights if they are not spread.
fn fixed_numbers(pixel: u32) -> vec2<f32> {
    return vec2<f32>(pcg4d(vec4<u32>(pixel, 0u, 0u, 0x2545f491u)).xy >> vec2<u32>(8u)) * (1.0 / 16777216.0);
}

fn spread(pixel: u32, numbers: SampleNumbers) -> SampleNumbers {
    if frame.is_spread != 0u {
        return numbers;
    }
    return SampleNumbers(
        vec4<f32>(numbers.light.xy, fixed_numbers(pixel)),
        vec4<f32>(0.5, 0.5, numbers.pixel.zw),
    );
}

fn radiance(pixel: u32, index: u32, corner: vec2<f32>, numbers: SampleNumbers) -> vec3<f32> {
    let direction = camera_direction(corner, numbers.pixel.xy);
    let hit = trace(frame.eye, direction, FAR, false, opacity_seed(pixel, index));
    camera_distance = hit.dist;
    if hit.object == NOTHING {
        return sky_radiance(direction);
    }
    return through_haze(surface_radiance(direction, hit, numbers), hit.dist);
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

// The share of the light of a sample that arrives past other surfaces.
fn unblocked_share(position: vec3<f32>, light: LightSample) -> f32 {
    var limit = light.dist * (1.0 - 1e-3);
    if light.is_delta != 0u {
        limit = light.dist - frame.lamp_clearance;
    }
    if !may_be_occluded(position, light.direction, limit) {
        shadow_rays.y += 1.0;
        return 1.0;
    }
    shadow_rays.x += 1.0;
    if trace(position, light.direction, min(limit, FAR), true, vec2<u32>(0u)).object != NOTHING {
        return 0.0;
    }
    return transmittance;
}

// The radiance that the surface of a hit sends against the direction of the ray.
fn surface_radiance(direction: vec3<f32>, hit: Hit, numbers: SampleNumbers) -> vec3<f32> {
    let at = met_surface(direction, hit);
    if at.is_unlit {
        return at.emitted;
    }
    light_splits = frame.splits;
    let kept = light_resample_by(shading_point(at), at.surface, numbers.light, numbers.pixel.w, frame.candidates);
    if kept.weight <= 0.0 {
        return at.emitted;
    }
    let contribution = reflected(at.surface, kept.chosen) * kept.weight;
    return at.emitted + contribution * unblocked_share(at.position, kept.chosen);
}

@compute @workgroup_size(8, 8)
fn render(@builtin(global_invocation_id) id: vec3<u32>) {
    let row = frame.row_begin + id.y;
    if id.x >= frame.width || row >= frame.row_end {
        return;
    }
    let pixel = row * frame.width + id.x;
    let slot = id.y * frame.width + id.x;
    // The counts of shadow rays and the distance of the last sample follow the sums of the whole band.
    // The first dispatch of a band starts both.
    let counts_slot = (frame.row_end - frame.row_begin) * frame.width + slot;
    var sum = vec4<f32>(0.0);
    if frame.sample_begin > 0u {
        sum = image[slot];
        shadow_rays = image[counts_slot].xy;
    }
    let sequence = pixel_sequence(vec2<u32>(id.x, row), frame.block_bits, frame.tile_bits);
    for (var index = frame.sample_begin; index < frame.sample_end; index += 1u) {
        let numbers = spread(pixel, sample_numbers(sequence, index));
        let color = radiance(pixel, index, vec2<f32>(f32(id.x), f32(row)), numbers);
        sum += vec4<f32>(color, select(0.0, luminance(color), index < frame.first_half));
    }
    image[slot] = sum;
    image[counts_slot] = vec4<f32>(shadow_rays, camera_distance, 0.0);
}

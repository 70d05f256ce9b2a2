// Lights that pixels keep from frame to frame and share with neighbours: the pass of docs/reuse.md. Twin of
// `history.rs`. A surface that moves finds the pixel that showed the same place.

const REUSES = true;
// How far away a neighbour is, in pixels along each axis, at most.
const REACH = 3.0;

// What a pixel keeps. `reservoir.count` is 0 for what reflects no light.
struct Kept {
    position: vec3<f32>,
    roughness: f32,
    normal: vec3<f32>,
    metallic: f32,
    base_color: vec3<f32>,
    reservoir: LightReservoir,
}

// Two frames in turn.
@group(0) @binding(6) var<storage, read_write> kept: array<Kept>;

fn keep_nothing(pixel: u32) {
    kept[frame.kept_first + pixel].reservoir = LightReservoir();
}

// The pixel of the last frame that showed a place, and its depth there; (0, 0, 0) if that was not in view.
fn place_then(position: vec3<f32>) -> vec3<f32> {
    let toward = position - frame.eye_then;
    let depth = dot(toward, frame.forward_then);
    let across = vec2<f32>(
        dot(toward, frame.right_then) / (dot(frame.right_then, frame.right_then) * depth),
        -dot(toward, frame.up_then) / (dot(frame.up_then, frame.up_then) * depth),
    );
    let place = floor((across + 1.0) * 0.5 * vec2<f32>(f32(frame.width), f32(frame.height)));
    return select(vec3<f32>(0.0), vec3<f32>(place, depth), depth > 0.0);
}

// Normals within 25 degrees, and planes within 2 % of the depth.
fn are_alike(at: MetSurface, then: Kept, depth: f32) -> bool {
    let apart = then.position - at.position;
    let away = max(abs(dot(at.surface.normal, apart)), abs(dot(then.normal, apart)));
    return dot(at.surface.normal, then.normal) > 0.9 && away < 0.02 * depth && length(apart) < 0.1 * depth;
}

// Merges what the n-th pixel of the last frame has kept: that of the place, and a neighbour.
fn merged(pixel: u32, n: u32, at: MetSurface, place: LightShadingPoint, own: LightReservoir) -> LightReservoir {
    let numbers = vec4<f32>(pcg4d(vec4<u32>(pixel, frame.seed, n, 0x9e3779b9u)) >> vec4<u32>(8u)) * (1.0 / 16777216.0);
    let there = place_then(at.position);
    let offset = select(vec2<f32>(0.0), round((numbers.xy * 2.0 - 1.0) * REACH), n > 0u);
    let pixel_then = there.xy + offset;
    let size = vec2<f32>(f32(frame.width), f32(frame.height));
    if there.z <= 0.0 || any(pixel_then < vec2<f32>(0.0)) || any(pixel_then >= size) {
        return own;
    }
    let then = kept[frame.kept_first_then + u32(pixel_then.y) * frame.width + u32(pixel_then.x)];
    if then.reservoir.count <= 0.0 || !are_alike(at, then, there.z) {
        return own;
    }
    var other = then.reservoir;
    other.count = min(other.count, frame.kept_draws);
    let view = normalize(frame.eye_then - then.position);
    let surface = Surface(then.base_color, then.roughness, then.normal, then.metallic, view);
    let at_then = MetSurface(surface, then.position, vec3<f32>(0.0), false);
    is_then = true;
    let own_there = reflected_target(at_then, light_reservoir_sample_previous(shading_point(at_then), own));
    is_then = false;
    let other_here = reflected_target(at, light_reservoir_sample(place, other));
    return light_reservoir_merge(own, own_there, other, other_here, numbers.z);
}

// The reservoir of a pixel with those of the last frame, which it keeps.
fn reused(pixel: u32, at: MetSurface, place: LightShadingPoint, fresh: LightReservoir) -> LightReservoir {
    var own = fresh;
    if frame.kept_draws > 0.0 {
        for (var n = 0u; n < 2u; n += 1u) {
            own = merged(pixel, n, at, place, own);
        }
    }
    let surface = at.surface;
    kept[frame.kept_first + pixel] =
        Kept(at.position, surface.roughness, surface.normal, surface.metallic, surface.base_color, own);
    return own;
}

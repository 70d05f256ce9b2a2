// Reuse over frames and pixels: each pixel keeps a reservoir. `docs/reuse.md` explains it.

struct Variant {
    // The cap on the count of kept reservoirs. With 0, nothing is reused.
    cap: f32,
    // How many neighbours of the last frame a pixel reuses besides itself.
    neighbours: u32,
    // The shadow rays of the last frame: 0 in its scene, 1 in that of this frame, as where an engine keeps only this one,
    // 2 for none.
    rays_then: u32,
    padding: u32,
}

struct Frame {
    number: u32,
    pixels_per_edge: u32,
    // New samples of a pixel.
    candidates: u32,
    // Where the reservoirs of the last frame begin; those of this one are in the other half.
    first_then: u32,
    // What the camera has moved by in x, now and in the last frame, in pixels.
    camera: vec2<i32>,
    // How high the walls hang, now and in the last frame.
    walls: vec2<f32>,
    // The frame is drawn once with each.
    variants: array<Variant, 7>,
}

@group(0) @binding(0) var<storage, read_write> kept: array<LightReservoir>;
@group(0) @binding(1) var<uniform> frame: Frame;

var<private> random_state: u32;

fn random() -> f32 {
    random_state = light_hash(random_state);
    return f32(random_state >> 8u) / 16777216.0;
}

// Whether a wall is in the way. Twin of `is_occluded` in main.rs.
fn is_occluded(origin: vec3<f32>, direction: vec3<f32>, max_dist: f32, walls: f32) -> bool {
    var is_hit = false;
    for (var i = 0u; i < 4u; i++) {
        let z = 4.0 * f32(i) - 6.0;
        let to_low = (vec3(-9.0, walls, z - 0.1) - origin) / direction;
        let to_high = (vec3(9.0, walls + 4.0, z + 0.1) - origin) / direction;
        let nears = min(to_low, to_high);
        let fars = max(to_low, to_high);
        let near = max(max(nears.x, nears.y), max(nears.z, 0.0));
        is_hit = is_hit || near <= min(min(fars.x, fars.y), min(fars.z, max_dist));
    }
    return is_hit;
}

// The point of a pixel. A renderer has it in its G-buffer.
fn point_of(pixel: vec2<i32>, camera: i32) -> LightShadingPoint {
    let place = 0.25 * (vec2<f32>(pixel + vec2(camera, 0)) + 0.5 - 0.5 * f32(frame.pixels_per_edge));
    return light_surface_point(vec3(place.x, 0.0, place.y), vec3(0.0, 1.0, 0.0));
}

// What a light reflects at a point, with shadows: here lux. A renderer multiplies by its BRDF.
fn reflected(at: LightShadingPoint, s: LightSample, walls: f32) -> f32 {
    if s.pmf <= 0.0 || is_occluded(at.position, s.direction, 0.999 * s.dist, walls) {
        return 0.0;
    }
    return s.radiance.y * dot(at.normal, s.direction) / s.pdf;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let edge = frame.pixels_per_edge;
    let index = id.x % (edge * edge);
    let pixel = vec2<i32>(vec2(index % edge, index / edge));
    let picture = id.y * groups.x * 64u + id.x - index;
    let variant = frame.variants[id.y];
    let at = point_of(pixel, frame.camera.x);
    random_state = light_hash((picture + index) ^ light_hash(frame.number));
    light_mark(at);

    // A new reservoir.
    let u = vec4(random(), random(), random(), random());
    var own = light_resample(at, u, random(), frame.candidates);
    own.reflected = reflected(at, light_reservoir_sample(at, own), frame.walls.x);

    // Those of the last frame: where the surface of this pixel was, then of its neighbours there.
    let before = pixel + vec2(frame.camera.x - frame.camera.y, 0);
    for (var i = 0u; i <= variant.neighbours && variant.cap > 0.0; i++) {
        var there = before;
        if i > 0u {
            there += vec2<i32>(round(6.0 * vec2(random(), random()) - 3.0));
        }
        if any(there < vec2(0)) || any(there >= vec2(i32(edge))) {
            continue;
        }
        var then = kept[frame.first_then + picture + u32(there.y) * edge + u32(there.x)];
        then.count = min(then.count, variant.cap);
        let at_then = point_of(there, frame.camera.y);
        let here = reflected(at, light_reservoir_sample(at, then), frame.walls.x);
        let light_then = light_reservoir_sample_previous(at_then, own);
        var own_there = 0.0;
        if variant.rays_then == 0u {
            own_there = reflected(at_then, light_then, frame.walls.y);
        } else {
            // No walls are in the way.
            own_there = reflected(at_then, light_then, 1.0e6);
            // In the scene of this frame, a ray goes to where the light is now.
            if variant.rays_then == 1u && reflected(at_then, light_reservoir_sample(at_then, own), frame.walls.x) <= 0.0 {
                own_there = 0.0;
            }
        }
        own = light_reservoir_merge(own, own_there, then, here, random());
    }
    let first = select(0u, arrayLength(&kept) / 2u, frame.first_then == 0u);
    kept[first + picture + index] = own;
}

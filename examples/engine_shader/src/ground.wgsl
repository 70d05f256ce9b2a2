// The engine's own shader: the illuminance of each pixel of the ground. The library's text is joined before it.

struct Frame {
    number: u32,
    samples: u32,
}
@group(0) @binding(0) var<storage, read_write> engine_lux: array<f32>;
@group(0) @binding(1) var<uniform> engine_frame: Frame;

// Four numbers in [0, 1), independent of each other and of those of other pixels, samples and frames.
fn engine_numbers(pixel: u32, sample: u32) -> vec4<f32> {
    var state = light_hash(pixel ^ light_hash(sample ^ light_hash(engine_frame.number)));
    var u: vec4<f32>;
    for (var i = 0; i < 4; i++) {
        state = light_hash(state);
        u[i] = f32(state >> 8u) / 16777216.0;
    }
    return u;
}

// The engine's shadow ray: whether the wall is in the way. Twin of `is_occluded` in main.rs.
fn engine_is_occluded(origin: vec3<f32>, direction: vec3<f32>, max_dist: f32) -> bool {
    let to_low = (vec3(-12.0, 0.0, 1.9) - origin) / direction;
    let to_high = (vec3(12.0, 1.5, 2.1) - origin) / direction;
    let nears = min(to_low, to_high);
    let fars = max(to_low, to_high);
    let near = max(max(nears.x, nears.y), max(nears.z, 0.0));
    return near <= min(min(fars.x, fars.y), min(fars.z, max_dist));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = id.y * 32u + id.x;
    let position = vec3(f32(id.x) - 15.5, 0.0, f32(id.y) - 15.5);
    let shading_point = light_surface_point(position, vec3(0.0, 1.0, 0.0));
    // From the next frame on, its cell has a cut, and samples have less noise.
    light_mark(shading_point);
    var sum = 0.0;
    for (var i = 0u; i < engine_frame.samples; i++) {
        let s = light_sample(shading_point, engine_numbers(pixel, i));
        // Lamps without size need no shorter rays; others end a little before the light.
        if s.pmf > 0.0 && !engine_is_occluded(position, s.direction, 0.999 * s.dist) {
            sum += s.radiance.y * s.direction.y / (s.pmf * s.pdf);
        }
    }
    // Black where no light arrives.
    engine_lux[pixel] = sum / f32(engine_frame.samples);
}

// Draws sparks over a band of a picture. `splat` adds each spark to the four pixels around it, unless what
// these show is nearer; `add_splats` adds the sums to the picture. Sums are whole numbers, so that their
// order does not matter.
//
// `festival.rs` defines the constants in capitals that this file does not.

struct View {
    // From the middle of the fire.
    eye: vec3<f32>,
    width: u32,
    // As in `surface.wgsl`.
    right: vec3<f32>,
    height: u32,
    up: vec3<f32>,
    row_begin: u32,
    forward: vec3<f32>,
    row_end: u32,
    samples: f32,
    first_half: f32,
    // Nits of white.
    white: f32,
}

struct Spark {
    position: vec3<f32>,
    age: f32,
    intensity: vec3<f32>,
    life: f32,
    births: u32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> sparks: array<Spark>;
// Red, green and blue of each pixel.
@group(0) @binding(2) var<storage, read_write> splats: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> image: array<vec4<f32>>;

// Parts of white in which sums are counted, and the most that one spark adds to a pixel, in white.
const PARTS: f32 = 4096.0;
const BRIGHTEST: f32 = 8.0;

fn put(pixel: vec2<i32>, dist: f32, share: f32, radiance: vec3<f32>) {
    let low = vec2<i32>(0, i32(view.row_begin));
    if any(pixel < low) || any(pixel >= vec2<i32>(i32(view.width), i32(view.row_end))) {
        return;
    }
    let slot = (u32(pixel.y) - view.row_begin) * view.width + u32(pixel.x);
    let band = (view.row_end - view.row_begin) * view.width;
    // The distance of what the last sample showed follows the sums of the whole band.
    if image[band + slot].z < dist {
        return;
    }
    let parts = vec3<u32>(min(radiance / view.white, vec3<f32>(BRIGHTEST)) * (share * PARTS) + 0.5);
    for (var channel = 0u; channel < 3u; channel += 1u) {
        atomicAdd(&splats[slot * 3u + channel], parts[channel]);
    }
}

@compute @workgroup_size(64)
fn splat(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&sparks) {
        return;
    }
    let spark = sparks[id.x];
    let offset = spark.position - view.eye;
    let depth = dot(offset, view.forward);
    if depth < 0.3 || all(spark.intensity <= vec3<f32>(0.0)) {
        return;
    }
    let half_size = vec2<f32>(dot(view.right, view.right), dot(view.up, view.up));
    let across = vec2<f32>(dot(offset, view.right), -dot(offset, view.up)) / (half_size * depth);
    let size = vec2<f32>(f32(view.width), f32(view.height));
    // Pixels cover equal areas of a plane at a distance of 1.
    let area = 4.0 * sqrt(half_size.x * half_size.y) / (size.x * size.y);
    let radiance = spark.intensity * (SHOWN / (depth * depth * area));
    let place = (across + 1.0) * 0.5 * size - 0.5;
    if any(abs(place) > size * 2.0) {
        return;
    }
    let corner = vec2<i32>(floor(place));
    let part = place - floor(place);
    let dist = length(offset);
    put(corner, dist, (1.0 - part.x) * (1.0 - part.y), radiance);
    put(corner + vec2<i32>(1, 0), dist, part.x * (1.0 - part.y), radiance);
    put(corner + vec2<i32>(0, 1), dist, (1.0 - part.x) * part.y, radiance);
    put(corner + vec2<i32>(1, 1), dist, part.x * part.y, radiance);
}

@compute @workgroup_size(64)
fn add_splats(@builtin(global_invocation_id) id: vec3<u32>) {
    let band = (view.row_end - view.row_begin) * view.width;
    if id.x >= band {
        return;
    }
    var color: vec3<f32>;
    for (var channel = 0u; channel < 3u; channel += 1u) {
        color[channel] = f32(atomicExchange(&splats[id.x * 3u + channel], 0u)) * (view.white / PARTS);
    }
    let luminance = dot(color, vec3<f32>(0.2126, 0.7152, 0.0722));
    image[id.x] += vec4<f32>(color * view.samples, luminance * view.first_half);
}

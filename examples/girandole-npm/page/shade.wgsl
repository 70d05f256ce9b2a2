// Adds samples of lights to the mean of each pixel. The text of the package comes before this one.

struct Frame { size: vec2<u32>, number: u32, averaged: u32, samples: u32 }
struct Box { low: vec3<f32>, high: vec3<f32> }

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var surfaces: texture_2d<f32>;
@group(0) @binding(2) var normals: texture_2d<f32>;
@group(0) @binding(3) var places: texture_2d<f32>;
@group(0) @binding(4) var<storage, read> boxes: array<Box>;
@group(0) @binding(5) var<storage, read_write> mean: array<vec4<f32>>;

const PI = 3.14159265;

/// Whether a box blocks a ray.
fn is_occluded(origin: vec3<f32>, direction: vec3<f32>, max_dist: f32) -> bool {
    let inverse = 1.0 / direction;
    for (var i = 0u; i < arrayLength(&boxes); i++) {
        let a = (boxes[i].low - origin) * inverse;
        let b = (boxes[i].high - origin) * inverse;
        let near = min(a, b);
        let far = max(a, b);
        let enter = max(max(near.x, near.y), max(near.z, 0.0));
        let leave = min(min(far.x, far.y), min(far.z, max_dist));
        if enter < leave {
            return true;
        }
    }
    return false;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let pixel = id.y * frame.size.x + id.x;
    let surface = textureLoad(surfaces, id.xy, 0).rgb;
    let normal = textureLoad(normals, id.xy, 0);
    let place = textureLoad(places, id.xy, 0);
    let nits = normal.w;
    // A texel that three.js has not drawn shows the sky, which is dark.
    var radiance = vec3(0.002, 0.003, 0.008);
    if place.w > 0.0 {
        radiance = surface * nits;
    }
    if place.w > 0.0 && nits == 0.0 {
        // Off the surface, by more than its position is rounded.
        let origin = place.xyz + 0.002 * normal.xyz;
        let shading_point = light_surface_point(origin, normalize(normal.xyz));
        light_mark(shading_point);
        var state = light_hash(pixel ^ light_hash(frame.number));
        for (var i = 0u; i < frame.samples; i++) {
            var u: vec4<f32>;
            for (var axis = 0; axis < 4; axis++) {
                state = light_hash(state);
                u[axis] = f32(state >> 8u) / 16777216.0;
            }
            let s = light_sample(shading_point, u);
            if s.pmf > 0.0 && !is_occluded(origin, s.direction, 0.999 * s.dist) {
                let cosine = max(dot(shading_point.normal, s.direction), 0.0);
                radiance += surface / PI * cosine * s.radiance / (s.pmf * s.pdf * f32(frame.samples));
            }
        }
    }
    let former = select(vec3(0.0), mean[pixel].rgb, frame.averaged > 0u);
    mean[pixel] = vec4(mix(former, radiance, 1.0 / f32(frame.averaged + 1u)), 1.0);
}

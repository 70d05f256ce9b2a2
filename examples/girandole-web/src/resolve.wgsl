// Mixes the samples of a frame with the last picture. While the camera or the scene moves, each pixel
// looks up its surface in the last picture.

struct View {
    eye: vec3<f32>,
    // The least share of the new frame in a pixel.
    least_share: f32,
    // Half the width, and below half the height, of the picture at a distance of 1.
    right: vec3<f32>,
    width: u32,
    up: vec3<f32>,
    height: u32,
    forward: vec3<f32>,
    // Samples of each pixel in `sums`; negative if neither the camera nor the scene has moved.
    samples: f32,
}

// A pixel of a picture: its radiance, and the distance of its surface and the number of frames that
// it comes from as two halves.
@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> last_view: View;
@group(0) @binding(2) var<storage, read> sums: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> last: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> picture: array<vec4<f32>>;

// The largest distance that a half holds, rounded down. The sky is there.
const FARTHEST: f32 = 60000.0;
// Surfaces whose distances differ by less than this share are taken for the same.
const SAME_SURFACE: f32 = 0.03;
// Distance, and number of frames.
fn details(pixel: vec4<f32>) -> vec2<f32> {
    return unpack2x16float(bitcast<u32>(pixel.w));
}

fn is_finite(color: vec3<f32>) -> bool {
    return all((bitcast<vec3<u32>>(color) & vec3<u32>(0x7f800000u)) != vec3<u32>(0x7f800000u));
}

// The radiance of a surface in the last picture, and the number of frames that it comes from; 0 if it
// was not visible.
fn last_color(pixel: vec2<u32>, dist: f32) -> vec4<f32> {
    if view.samples < 0.0 {
        let old = last[pixel.y * view.width + pixel.x];
        return vec4<f32>(old.xyz, details(old).y);
    }
    let size = vec2<f32>(f32(view.width), f32(view.height));
    let across = (vec2<f32>(pixel) + 0.5) / size * 2.0 - 1.0;
    let direction = normalize(view.forward + view.right * across.x - view.up * across.y);
    let toward = view.eye + direction * dist - last_view.eye;
    let depth = dot(toward, last_view.forward);
    if depth <= 0.0 {
        return vec4<f32>(0.0);
    }
    // The axes are perpendicular, and their lengths are the halves of the picture.
    let there = vec2<f32>(
        dot(toward, last_view.right) / dot(last_view.right, last_view.right),
        -dot(toward, last_view.up) / dot(last_view.up, last_view.up),
    );
    let place = (there / depth * 0.5 + 0.5) * size - 0.5;
    let low = floor(place);
    let share = place - low;
    let expected = min(length(toward), FARTHEST);
    // Bilinear, over the neighbours that show the same surface.
    var sum = vec4<f32>(0.0);
    var total = 0.0;
    for (var corner = 0u; corner < 4u; corner += 1u) {
        let offset = vec2<f32>(f32(corner & 1u), f32(corner >> 1u));
        let at = low + offset;
        if any(at < vec2<f32>(0.0)) || any(at >= size) {
            continue;
        }
        let old = last[u32(at.y) * view.width + u32(at.x)];
        // A color that is not finite would stay, and spread.
        if !is_finite(old.xyz) || abs(details(old).x - expected) > expected * SAME_SURFACE {
            continue;
        }
        let sides = mix(1.0 - share, share, offset);
        let weight = sides.x * sides.y;
        sum += vec4<f32>(old.xyz, details(old).y) * weight;
        total += weight;
    }
    return select(vec4<f32>(0.0), sum / max(total, 0.01), total >= 0.01);
}

@compute @workgroup_size(8, 8)
fn resolve(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= view.width || id.y >= view.height {
        return;
    }
    let slot = id.y * view.width + id.x;
    let sum = sums[slot].xyz / abs(view.samples);
    let color = select(vec3<f32>(0.0), sum, is_finite(sum));
    let dist = min(sums[view.width * view.height + slot].z, FARTHEST);
    var frames = 1.0;
    var mixed = color;
    if view.least_share < 1.0 {
        let history = last_color(id.xy, dist);
        if history.w > 0.0 {
            frames = min(history.w + 1.0, 1.0 / view.least_share);
            mixed = mix(history.xyz, color, 1.0 / frames);
        }
    }
    picture[slot] = vec4<f32>(mixed, bitcast<f32>(pack2x16float(vec2<f32>(dist, frames))));
}

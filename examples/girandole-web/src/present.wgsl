// Shows a picture on the canvas: exposure, the AgX curve with its "punchy" look, and the encoding of
// sRGB, which the curve includes. Twin of `agx` in the city's `tone_mapping.rs`, which states the
// source.

struct Screen {
    width: u32,
    exposure: f32,
}

@group(0) @binding(0) var<uniform> screen: Screen;
@group(0) @binding(1) var<storage, read> picture: array<vec4<f32>>;

const MIN_EV: f32 = -12.47393;
const MAX_EV: f32 = 4.026069;

// A triangle that covers the canvas.
@vertex
fn cover(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4<f32>(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

fn agx(linear: vec3<f32>) -> vec3<f32> {
    let inset = mat3x3<f32>(
        0.84247906, 0.042328242, 0.042375655,
        0.0784336, 0.8784686, 0.0784336,
        0.079223745, 0.07916613, 0.879143,
    );
    let outset = mat3x3<f32>(
        1.196879, -0.05289685, -0.052971635,
        -0.09802088, 1.1519031, -0.09804345,
        -0.09902974, -0.09896118, 1.1510737,
    );
    let x = clamp((log2(max(inset * linear, vec3<f32>(1e-10))) - MIN_EV) / (MAX_EV - MIN_EV), vec3<f32>(0.0), vec3<f32>(1.0));
    let x2 = x * x;
    let x4 = x2 * x2;
    let curve = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    let contrast = pow(max(curve, vec3<f32>(0.0)), vec3<f32>(1.25));
    let gray = dot(contrast, vec3<f32>(0.2126, 0.7152, 0.0722));
    return clamp(outset * mix(vec3<f32>(gray), contrast, 1.35), vec3<f32>(0.0), vec3<f32>(1.0));
}

@fragment
fn show(@builtin(position) place: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(place.xy);
    let radiance = picture[pixel.y * screen.width + pixel.x].xyz;
    return vec4<f32>(agx(max(radiance * screen.exposure, vec3<f32>(0.0))), 1.0);
}

// Shows the mean of each pixel.

struct Frame { size: vec2<u32> }

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> mean: array<vec4<f32>>;

const EXPOSURE = 1.7;

/// One triangle that covers the picture.
@vertex
fn corner(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

/// Compresses the luminance, which keeps the colours of bright lamps; then an approximate sRGB encoding.
@fragment
fn show(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = u32(position.y) * frame.size.x + u32(position.x);
    let exposed = EXPOSURE * mean[pixel].rgb;
    let mapped = 1.4 * exposed / (1.0 + dot(exposed, vec3(0.2126, 0.7152, 0.0722)));
    return vec4(pow(clamp(mapped, vec3(0.0), vec3(1.0)), vec3(1.0 / 2.2)), 1.0);
}

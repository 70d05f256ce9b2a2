
// The pass that adds Girandole's light to the picture, after Bevy's deferred lighting.

// Twin of `ViewUniform` in pass.rs.
struct GirandoleView {
    seed: u32,
    frame: u32,
    candidates: u32,
    samples: u32,
    still_frames: u32,
    moving_frames: u32,
    is_exhaustive: u32,
    // Slots of instances, and directional lights.
    slots: u32,
    directionals: u32,
    has_history: u32,
    lights_moved: u32,
    heat_map: u32,
    // Frames that a kept light stands for at most, and the width of the picture in pixels.
    reused_frames: u32,
    width: u32,
    // Whether what pixels keep is shown.
    shows_history: u32,
    padding: u32,
}

@group(2) @binding(1) var<uniform> girandole_view: GirandoleView;
// The mean before, and the frames that it is of.
@group(2) @binding(2) var girandole_past: texture_2d<f32>;
// The distance from the camera before, in metres; 0 for the sky.
@group(2) @binding(3) var girandole_past_dist: texture_2d<f32>;
// The lights that pixels have kept in the frame before and in this one, row by row.
@group(2) @binding(8) var<storage, read> girandole_past_kept: array<LightReservoir>;
@group(2) @binding(9) var<storage, read_write> girandole_kept: array<LightReservoir>;

struct GirandoleOutput {
    // Is added to the picture.
    @location(0) color: vec4<f32>,
    @location(1) mean: vec4<f32>,
    @location(2) dist: f32,
}

// How much the distance of a point may differ between two frames, as a share.
const GIRANDOLE_SAME_DIST: f32 = 0.05;
// How much the normals of two surfaces that share lights may differ, as a cosine, and how far one may be from the plane
// of the other, as a share of the distance.
const GIRANDOLE_SAME_COSINE: f32 = 0.9;
const GIRANDOLE_SAME_PLANE: f32 = 0.02;
// Pixels by which a surface moves and still counts as still.
const GIRANDOLE_STILL: f32 = 0.01;

// Whether no component is infinite or NaN. Compilers may assume that floats are finite, so this tests bits.
fn girandole_is_finite(value: vec4<f32>) -> bool {
    return all((bitcast<vec4<u32>>(value) & vec4(0x7f800000u)) != vec4(0x7f800000u));
}

// The mean of the frames before at a place in pixels, with the number of frames.
fn girandole_mean_at(place: vec2<f32>, dist: f32) -> vec4<f32> {
    let size = vec2<i32>(textureDimensions(girandole_past));
    let corner = place - 0.5;
    let first = floor(corner);
    let share = corner - first;
    var sum = vec4(0.0);
    var weights = 0.0;
    for (var i = 0; i < 4; i++) {
        let offset = vec2(i & 1, i >> 1u);
        let texel = vec2<i32>(first) + offset;
        let weight_xy = select(1.0 - share, share, offset == vec2(1));
        let weight = weight_xy.x * weight_xy.y;
        if any(texel < vec2(0)) || any(texel >= size) || weight < 0.001 {
            continue;
        }
        let past_dist = textureLoad(girandole_past_dist, texel, 0).x;
        if abs(past_dist - dist) > GIRANDOLE_SAME_DIST * dist {
            continue;
        }
        let past = textureLoad(girandole_past, texel, 0);
        if !girandole_is_finite(past) {
            continue;
        }
        sum += weight * past;
        weights += weight;
    }
    if weights < 0.001 {
        return vec4(0.0);
    }
    return sum / weights;
}

@fragment
fn girandole_fragment(@builtin(position) position: vec4<f32>) -> GirandoleOutput {
    if !girandole_is_there() {
        return GirandoleOutput(vec4(0.0), vec4(0.0), 0.0);
    }
    let shown = girandole_pixel(position);
    if !shown.is_lit {
        return GirandoleOutput(vec4(0.0), vec4(0.0), 0.0);
    }
    let surface = shown.surface;
    let texel = vec2<i32>(position.xy);
    let pixel = light_hash(u32(texel.x) ^ light_hash(u32(texel.y)));
    let seed = pixel ^ light_hash(girandole_view.frame ^ light_hash(girandole_view.seed));

    // Its cell has a cut from the next frame on.
    light_mark(girandole_shading_point(surface));
    var estimate = girandole_estimate(surface, texel, seed);
    if !girandole_is_finite(vec4(estimate, 0.0)) {
        estimate = vec3(0.0);
    }

    let dist = distance(mesh_view_bindings::view.world_position, surface.P);
    var mean = estimate;
    var frames = 1.0;
    if girandole_view.has_history != 0u {
        let motion_uv = textureLoad(mesh_view_bindings::motion_vector_prepass_texture, texel, 0).xy;
        let motion = motion_uv * mesh_view_bindings::view.viewport.zw;
        let past = girandole_mean_at(position.xy - motion, dist);
        let is_still = girandole_view.lights_moved == 0u && all(abs(motion) < vec2(GIRANDOLE_STILL));
        let limit = f32(select(girandole_view.moving_frames, girandole_view.still_frames, is_still));
        frames = max(min(past.w + 1.0, limit), 1.0);
        mean = past.xyz + (estimate - past.xyz) / frames;
    }
    return GirandoleOutput(vec4(mean * mesh_view_bindings::view.exposure, 0.0), vec4(mean, frames), dist);
}

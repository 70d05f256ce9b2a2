// The engine's own shaders, in WGSL. The text of girandole_shader_include, for group 1, goes before them.
#pragma once

#include <cstdint>

constexpr uint32_t POINTS = 16;       // shading points that measure visits
constexpr uint32_t INVOCATIONS = 128; // for each of them
constexpr uint32_t SAMPLES = 64;      // that each invocation takes
constexpr uint32_t KERNEL_LIGHTS = 256; // lights that put_lights writes
constexpr uint32_t WIDTH = 512, HEIGHT = 288;

// The shading points of measure: a grid on the ground, 2.4 m apart.
inline float measured_x(uint32_t point) { return 2.4f * static_cast<float>(point % 4) - 3.6f; }
inline float measured_z(uint32_t point) { return 2.4f * static_cast<float>(point / 4) - 3.6f; }

constexpr const char *ENGINE_WGSL = R"(
@group(0) @binding(0) var<storage, read_write> engine_out: array<vec4<f32>>;

fn engine_numbers(seed: u32) -> vec4<f32> {
    var u: vec4<f32>;
    var state = seed;
    for (var i = 0; i < 4; i++) {
        state = light_hash(state);
        u[i] = f32(state >> 8u) / 16777216.0;
    }
    return u;
}

fn engine_lux(s: LightSample) -> vec3<f32> {
    return select(vec3(0.0), s.radiance * s.direction.y / (s.pmf * s.pdf), s.pmf > 0.0);
}

// The sum of the illuminance of 64 samples, and of its square, for each invocation.
@compute @workgroup_size(64)
fn measure(@builtin(global_invocation_id) id: vec3<u32>) {
    let position = vec3(2.4 * f32(id.y % 4u) - 3.6, 0.0, 2.4 * f32(id.y / 4u) - 3.6);
    let ground = light_surface_point(position, vec3(0.0, 1.0, 0.0));
    light_mark(ground);
    var sums = vec2(0.0);
    for (var i = 0u; i < 64u; i++) {
        let lux = engine_lux(light_sample(ground, engine_numbers((id.y * 128u + id.x) * 64u + i))).y;
        sums += vec2(lux, lux * lux);
    }
    engine_out[id.y * 128u + id.x] = vec4(sums, 0.0, 0.0);
}

// A tiled ground plane as seen from (0, 7, -17): what leaves it, in nits, and the distance to it, or 0 for sky.
@compute @workgroup_size(8, 8)
fn shade(@builtin(global_invocation_id) id: vec3<u32>) {
    let screen = (vec2<f32>(id.xy) + 0.5 - vec2(256.0, 144.0)) / 144.0;
    // The view is tilted down by 0.45 radians.
    let view = vec3(0.65 * screen.x, -0.65 * screen.y, 1.0);
    let tilted = vec3(view.x, view.y * 0.90045 - view.z * 0.43497, view.y * 0.43497 + view.z * 0.90045);
    let ray = normalize(tilted);
    let pixel = id.y * 512u + id.x;
    if ray.y > -0.01 {
        engine_out[pixel] = vec4(0.0);
        return;
    }
    let dist = 7.0 / -ray.y;
    let position = vec3(0.0, 7.0, -17.0) + dist * ray;
    let ground = light_surface_point(vec3(position.x, 0.0, position.z), vec3(0.0, 1.0, 0.0));
    light_mark(ground);
    var lux = vec3(0.0);
    for (var i = 0u; i < 8u; i++) {
        lux += engine_lux(light_sample(ground, engine_numbers(pixel * 8u + i))) / 8.0;
    }
    let tile = (i32(floor(position.x)) + i32(floor(position.z))) & 1;
    let albedo = select(0.35, 0.6, tile == 0);
    engine_out[pixel] = vec4(lux * albedo / 3.14159265, dist);
}
)";

// As measure, in a corner of two walls, which hide three quarters of the sky. Where cells learn, RECORD becomes a call that tells what
// shadow rays find.
constexpr const char *CORNER_WGSL = R"(
@compute @workgroup_size(64)
fn measure_corner(@builtin(global_invocation_id) id: vec3<u32>) {
    let position = vec3(2.4 * f32(id.y % 4u) - 3.6, 0.0, 2.4 * f32(id.y / 4u) - 3.6);
    let ground = light_surface_point(position, vec3(0.0, 1.0, 0.0));
    light_mark(ground);
    var sums = vec2(0.0);
    for (var i = 0u; i < 64u; i++) {
        let s = light_sample(ground, engine_numbers((id.y * 128u + id.x) * 64u + i));
        let is_visible = min(s.direction.x, s.direction.z) > 0.0;
        // RECORD
        let lux = select(0.0, engine_lux(s).y, is_visible);
        sums += vec2(lux, lux * lux);
    }
    engine_out[id.y * 128u + id.x] = vec4(sums, 0.0, 0.0);
}
)";

// A kernel that writes lights: a grid of lamps. The text of girandole_shader_sources goes before it.
constexpr const char *KERNEL_WGSL = R"(
@compute @workgroup_size(64)
fn put_lights(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= light_source_count(0u) {
        return;
    }
    let place = vec3(0.75 * f32(id.x % 16u) - 6.0, 0.5 + 0.125 * f32(id.x % 8u), 0.75 * f32(id.x / 16u) - 6.0);
    light_put_point(0u, id.x, place, vec3(1.0 + f32(id.x % 5u)));
}
)";

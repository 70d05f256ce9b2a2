// Two ways to shade that know no tree: one light of a list, each with the same probability, and all
// lights of the list. `render.wgsl` of the city, which precedes this file, has the rest.

// In row-major order: the number of lights, then the slot of the instance and the index of each light.
@group(2) @binding(0) var light_list: texture_2d<u32>;

fn listed(index: u32) -> vec2<u32> {
    let width = textureDimensions(light_list).x;
    return textureLoad(light_list, vec2<u32>(index % width, index / width), 0).xy;
}

// A point on one light of the list, with the given probability of that light.
fn listed_light(number: u32, pmf: f32, at: MetSurface, u: vec2<f32>) -> LightSample {
    let names = listed(number + 1u);
    var kept = light_reservoir_of(names.x, names.y, u);
    kept.weight /= pmf;
    return light_reservoir_sample(shading_point(at), kept);
}

// The radiance that a light adds; black where nothing arrives.
fn arriving(at: MetSurface, light: LightSample) -> vec3<f32> {
    if light.pmf <= 0.0 {
        return vec3<f32>(0.0);
    }
    let contribution = reflected(at.surface, light) / (light.pdf * light.pmf);
    if all(contribution <= vec3<f32>(0.0)) {
        return vec3<f32>(0.0);
    }
    return contribution * unblocked_share(at.position, light);
}

// As `render`, with lights that all have the same probability.
@compute @workgroup_size(8, 8)
fn render_uniform(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= frame.width || id.y >= frame.row_end {
        return;
    }
    let slot = id.y * frame.width + id.x;
    var sum = vec4<f32>(0.0);
    if frame.sample_begin > 0u {
        sum = image[slot];
    }
    let count = listed(0u).x;
    let sequence = pixel_sequence(id.xy, frame.block_bits, frame.tile_bits);
    for (var index = frame.sample_begin; index < frame.sample_end; index += 1u) {
        let numbers = sample_numbers(sequence, index);
        let direction = camera_direction(vec2<f32>(id.xy), numbers.pixel.xy);
        let hit = trace(frame.eye, direction, FAR, false, opacity_seed(slot, index));
        camera_distance = hit.dist;
        if hit.object == NOTHING {
            sum += vec4<f32>(sky_radiance(direction), 0.0);
            continue;
        }
        let at = met_surface(direction, hit);
        let number = min(u32(numbers.light.x * f32(count)), count - 1u);
        let light = listed_light(number, 1.0 / f32(count), at, numbers.light.zw);
        sum += vec4<f32>(through_haze(at.emitted + arriving(at, light), hit.dist), 0.0);
    }
    image[slot] = sum;
    image[frame.row_end * frame.width + slot] = vec4<f32>(shadow_rays, camera_distance, 0.0);
}

// Adds the light of the lights [sample_begin, sample_end) of the list, from the points on them that
// `render` takes where samples are not spread and have one candidate. The first dispatch starts the sum with what the surface
// emits, or with the sky.
@compute @workgroup_size(8, 8)
fn add_all_lights(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= frame.width || id.y >= frame.row_end {
        return;
    }
    let slot = id.y * frame.width + id.x;
    let direction = camera_direction(vec2<f32>(id.xy), vec2<f32>(0.5));
    let hit = trace(frame.eye, direction, FAR, false, opacity_seed(slot, 0u));
    if hit.object == NOTHING {
        image[slot] = vec4<f32>(sky_radiance(direction), 0.0);
        return;
    }
    let at = met_surface(direction, hit);
    var sum = vec3<f32>(0.0);
    for (var number = frame.sample_begin; number < frame.sample_end; number += 1u) {
        sum += arriving(at, listed_light(number, 1.0, at, fixed_numbers(slot)));
    }
    // What haze takes from the light, it takes from each part of the sum.
    let clear = exp(-hit.dist * frame.haze);
    if frame.sample_begin == 0u {
        image[slot] = vec4<f32>(through_haze(at.emitted + sum, hit.dist), 0.0);
    } else {
        image[slot] += vec4<f32>(sum * clear, 0.0);
    }
}

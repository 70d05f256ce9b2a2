// Each invocation renders one pixel: camera ray, nearest hit, several candidates from the library of
// which one is kept, shadow ray, shading.
//
// The library's text is that of group 1. Sky and BRDF are twins of `shading.rs`. The
// test `both_backends_render_the_same_picture` compares them.

fn sky_radiance(direction: vec3<f32>) -> vec3<f32> {
    let toward_sun = max(dot(direction, frame.sun), 0.0);
    let squared = toward_sun * toward_sun;
    let glow = squared * squared * squared * squared;
    return mix(frame.horizon, frame.zenith, sqrt(max(direction.y, 0.0))) + frame.glow * glow;
}

fn through_haze(radiance: vec3<f32>, dist: f32) -> vec3<f32> {
    let clear = exp(-dist * frame.haze);
    return radiance * clear + frame.horizon * (1.0 - clear);
}

fn brdf(surface: Surface, light: vec3<f32>) -> vec3<f32> {
    let base_color = surface.base_color;
    let roughness = surface.roughness;
    let metallic = surface.metallic;
    let normal = surface.normal;
    let view = surface.view;
    let halfway = normalize(view + light);
    let n_dot_l = max(dot(normal, light), 0.0);
    let n_dot_v = max(dot(normal, view), 1e-4);
    let n_dot_h = dot(normal, halfway);
    let v_dot_h = clamp(dot(view, halfway), 0.0, 1.0);

    let alpha = max(roughness * roughness, 1e-3);
    let alpha_sq = alpha * alpha;
    let n_cross_h = cross(normal, halfway);
    let scaled = n_dot_h * alpha;
    let k = alpha / (dot(n_cross_h, n_cross_h) + scaled * scaled);
    let distribution = k * k / PI;
    let lambda_v = n_dot_l * sqrt(n_dot_v * n_dot_v * (1.0 - alpha_sq) + alpha_sq);
    let lambda_l = n_dot_v * sqrt(n_dot_l * n_dot_l * (1.0 - alpha_sq) + alpha_sq);
    let visibility = 0.5 / max(lambda_v + lambda_l, 1e-12);

    let f0 = specular_reflectance(surface);
    let grazing = 1.0 - v_dot_h;
    let grazing_sq = grazing * grazing;
    let fresnel = f0 + (1.0 - f0) * (grazing_sq * grazing_sq * grazing);
    let diffuse = base_color * ((1.0 - metallic) / PI);
    return (1.0 - fresnel) * diffuse + fresnel * (distribution * visibility);
}

// The radiance that one point of a light adds if nothing blocks it, not yet divided by a density.
fn reflected(surface: Surface, light: LightSample) -> vec3<f32> {
    let cosine = dot(surface.normal, light.direction);
    if cosine <= 0.0 {
        return vec3<f32>(0.0);
    }
    return brdf(surface, light.direction) * light.radiance * cosine;
}

// Whether something may block a ray within a distance. Twin of `Occluders::may_block` in
// `geometry.rs`.
fn may_be_occluded(origin: vec3<f32>, direction: vec3<f32>, limit: f32) -> bool {
    let end = origin + direction * min(limit, FAR);
    let low = select(frame.occluder_min, frame.occluder_min_then, is_then);
    let high = select(frame.occluder_max, frame.occluder_max_then, is_then);
    return limit > 0.0 && all(min(origin, end) <= high) && all(max(origin, end) >= low);
}

// The numbers of shadow rays that this invocation traced, and that it skipped because nothing could
// block them.
var<private> shadow_rays: vec2<f32>;
// The distance of the last hit of a camera ray, or FAR.
var<private> camera_distance: f32;

// The numbers by which all samples of a pixel choose points on lights if they are not spread.
fn fixed_numbers(pixel: u32) -> vec2<f32> {
    return vec2<f32>(pcg4d(vec4<u32>(pixel, 0u, 0u, 0x2545f491u)).xy >> vec2<u32>(8u)) * (1.0 / 16777216.0);
}

fn spread(pixel: u32, numbers: SampleNumbers) -> SampleNumbers {
    if frame.is_spread != 0u {
        return numbers;
    }
    return SampleNumbers(
        vec4<f32>(numbers.light.xy, fixed_numbers(pixel)),
        vec4<f32>(0.5, 0.5, numbers.pixel.zw),
    );
}

fn radiance(pixel: u32, index: u32, corner: vec2<f32>, numbers: SampleNumbers) -> vec3<f32> {
    keep_nothing(pixel);
    let direction = camera_direction(corner, numbers.pixel.xy);
    let hit = trace(frame.eye, direction, FAR, false, opacity_seed(pixel, index));
    camera_distance = hit.dist;
    if hit.object == NOTHING {
        return sky_radiance(direction);
    }
    return through_haze(surface_radiance(pixel, direction, hit, numbers), hit.dist);
}

// The share of the light of a sample that arrives past other surfaces.
fn unblocked_share(position: vec3<f32>, light: LightSample) -> f32 {
    var limit = light.dist * (1.0 - 1e-3);
    if light.is_delta != 0u {
        limit = light.dist - frame.lamp_clearance;
    }
    if !may_be_occluded(position, light.direction, limit) {
        shadow_rays.y += 1.0;
        return 1.0;
    }
    shadow_rays.x += 1.0;
    if trace(position, light.direction, min(limit, FAR), true, vec2<u32>(0u)).object != NOTHING {
        return 0.0;
    }
    return transmittance;
}

// The luminance of the light of a sample as if its light was the only one, without and with shadows.
fn unshadowed_target(surface: Surface, light: LightSample) -> f32 {
    if light.pmf <= 0.0 {
        return 0.0;
    }
    return luminance(reflected(surface, light)) / light.pdf;
}

fn reflected_target(at: MetSurface, light: LightSample) -> f32 {
    let unshadowed = unshadowed_target(at.surface, light);
    if unshadowed <= 0.0 {
        return 0.0;
    }
    return unshadowed * unblocked_share(at.position, light);
}

// The radiance that the surface of a hit sends against the direction of the ray.
fn surface_radiance(pixel: u32, direction: vec3<f32>, hit: Hit, numbers: SampleNumbers) -> vec3<f32> {
    let at = met_surface(direction, hit);
    if at.is_unlit {
        return at.emitted;
    }
    let place = shading_point(at);
    var own = light_resample(place, numbers.light, numbers.pixel.w, frame.candidates);
    var light = light_reservoir_sample(place, own);
    own.reflected = reflected_target(at, light);
    if REUSES {
        own = reused(pixel, at, place, own);
        light = light_reservoir_sample(place, own);
    }
    if own.reflected <= 0.0 || light.pmf <= 0.0 {
        return at.emitted;
    }
    // The share that passes what is in the way.
    let share = own.reflected / unshadowed_target(at.surface, light);
    return at.emitted + reflected(at.surface, light) * (share / (light.pmf * light.pdf));
}

@compute @workgroup_size(8, 8)
fn render(@builtin(global_invocation_id) id: vec3<u32>) {
    let row = frame.row_begin + id.y;
    if id.x >= frame.width || row >= frame.row_end {
        return;
    }
    let pixel = row * frame.width + id.x;
    let slot = id.y * frame.width + id.x;
    // The counts of shadow rays and the distance of the last sample follow the sums of the whole band.
    // The first dispatch of a band starts both.
    let counts_slot = (frame.row_end - frame.row_begin) * frame.width + slot;
    var sum = vec4<f32>(0.0);
    if frame.sample_begin > 0u {
        sum = image[slot];
        shadow_rays = image[counts_slot].xy;
    }
    let sequence = pixel_sequence(vec2<u32>(id.x, row), frame.block_bits, frame.tile_bits);
    for (var index = frame.sample_begin; index < frame.sample_end; index += 1u) {
        let numbers = spread(pixel, sample_numbers(sequence, index));
        let color = radiance(pixel, index, vec2<f32>(f32(id.x), f32(row)), numbers);
        sum += vec4<f32>(color, select(0.0, luminance(color), index < frame.first_half));
    }
    image[slot] = sum;
    image[counts_slot] = vec4<f32>(shadow_rays, camera_distance, 0.0);
}

// Bevy's lighting by one light that Girandole chose: what `point_light`, `spot_light` and
// `directional_light` of bevy_pbr compute, with Bevy's own BRDF.

// What differs between kinds of light. Twin of `KindRecord` in kinds.rs.
struct GirandoleKind {
    range: f32,
    radius: f32,
    weight: f32,
    nits: f32,
    lights: u32,
    padding_a: u32,
    padding_b: u32,
    padding_c: u32,
}

@group(2) @binding(0) var<storage, read> girandole_kinds: array<GirandoleKind>;

// The factor between the light that Girandole's sample brings and that of Bevy's light. Girandole has
// the window of glTF, of which Bevy takes the square. Bevy's lights stop to grow at a distance of a
// centimetre. What emissive surfaces emit depends on the exposure.
fn girandole_factor(kind: GirandoleKind, is_delta: bool, dist: f32) -> f32 {
    if !is_delta {
        let exposure = mesh_view_bindings::view.exposure;
        return mix(1.0, exposure, kind.weight) / (exposure * kind.nits);
    }
    let dist_sq = dist * dist;
    let ratio_sq = dist_sq / (kind.range * kind.range);
    return saturate(1.0 - ratio_sq * ratio_sq) * dist_sq / max(dist_sq, 0.0001);
}

struct GirandoleLobe {
    // Toward the light as the highlight sees it.
    derived: lighting::DerivedLightingInput,
    roughness: f32,
    intensity: f32,
    // What the horizon leaves of a light with a radius.
    visible: f32,
}

// The highlight of a layer by a light with a radius, as in Bevy's `point_light`.
fn girandole_lobe(input: ptr<function, LightingInput>, layer: u32, to_light: vec3<f32>, radius: f32) -> GirandoleLobe {
    let dist = length(to_light);
    let normal = (*input).layers[layer].N;
    let alpha = (*input).layers[layer].roughness;
    let values = lighting::compute_specular_layer_values_for_point_light(
        input, layer, (*input).V, to_light, radius, dist);
    var lobe: GirandoleLobe;
    lobe.derived = lighting::derive_lighting_input(normal, (*input).V, values.xyz);
    let normalization = alpha / values.w;
    lobe.intensity = normalization * normalization;
    lobe.roughness = mix(alpha, values.w, lighting::specular_fix_remap(alpha));
    lobe.visible = 1.0;
    if radius > 0.0 {
        let solid_angle = radius * radius / (dist * dist);
        lobe.visible = saturate(lobe.derived.NdotL / max(lobe.derived.NdotL + solid_angle, 1e-4));
    }
    return lobe;
}

// The BRDF times the cosine, for a vector to a light in metres.
fn girandole_brdf(surface: LightingInput, to_light: vec3<f32>, radius: f32) -> vec3<f32> {
    var input = surface;
    // Pointers to members of structures cannot be passed on, so both are copied.
    let base = girandole_lobe(&input, lighting::LAYER_BASE, to_light, radius);
    var base_derived = base.derived;
    let specular_light =
        lighting::specular(&input, &base_derived, base.roughness, base.intensity) * base.visible;
    let coat = girandole_lobe(&input, lighting::LAYER_CLEARCOAT, to_light, radius);
    var coat_derived = coat.derived;
    let fc_frc = lighting::specular_clearcoat(
        &input, &coat_derived, input.clearcoat_strength, coat.roughness, coat.intensity);
    let under = 1.0 - fc_frc.x;
    var derived = lighting::derive_lighting_input(input.layers[lighting::LAYER_BASE].N, input.V, normalize(to_light));
    let diffuse = input.diffuse_color * lighting::Fd_Burley(&input, &derived);
    return (diffuse * derived.NdotL + specular_light * base.derived.NdotL * under) * under
        + fc_frc.y * coat.visible * coat.derived.NdotL;
}

// The light that a surface reflects of a sample, before division by its probability. Without shadows.
fn girandole_reflected(surface: LightingInput, light: LightSample) -> vec3<f32> {
    if light.pmf <= 0.0 {
        return vec3(0.0);
    }
    if light.instance == LIGHT_DIRECTIONAL {
        return girandole_brdf(surface, light.direction, 0.0) * light.radiance;
    }
    let kind = girandole_kinds[light_user_data(light.instance)];
    let is_delta = light.is_delta == 1u;
    let radius = select(0.0, kind.radius, is_delta);
    // Only a radius needs the distance, which is too large to be squared twice for the sky.
    let brdf = girandole_brdf(surface, light.direction * select(1.0, light.dist, is_delta), radius);
    return brdf * light.radiance * girandole_factor(kind, is_delta, light.dist);
}

// Six random numbers in [0, 1), and random bits.
struct GirandoleNumbers {
    u: vec4<f32>,
    choice: f32,
    more: f32,
    bits: u32,
}

fn girandole_numbers(seed: u32) -> GirandoleNumbers {
    var state = seed;
    var numbers: array<f32, 6>;
    for (var i = 0u; i < 6u; i++) {
        state = light_hash(state + 0x9e3779b9u);
        numbers[i] = f32(state >> 8u) / 16777216.0;
    }
    return GirandoleNumbers(vec4(numbers[0], numbers[1], numbers[2], numbers[3]), numbers[4], numbers[5], state);
}

// Whether there are lights. To be asked at the start of a shader that draws some: it also keeps Mesa 26's llvmpipe, which
// merges reads of several buffers, from a read through no buffer when no invocation is left in a loop.
fn girandole_is_there() -> bool {
    return min(min(arrayLength(&light_top), arrayLength(&light_nodes)), arrayLength(&light_cuts.quads)) > 0u;
}

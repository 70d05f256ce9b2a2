// Chooses one of several candidates. Twin of src/sampling/resample.rs, which explains it.

// The candidate that light_resample kept, and its weight. brdf * cosine * chosen.radiance * weight
// estimates the light that arrives from all lights, if the point is not in shadow: `weight`
// replaces 1 / (pmf * pdf).
struct LightReservoir {
    // The candidate that was kept, with its own pmf and pdf. Its pmf is 0 if no candidate sends any
    // light.
    chosen: LightSample,
    // In steradians for surfaces, without unit for lights without size. 0 if no candidate sends any
    // light: count that as black.
    weight: f32,
}

// A number shifted along a lattice, modulo 1.
fn light_shifted(u: f32, i: u32, step: u32) -> f32 {
    let sum = light_clamp_unit(u) + f32((i * step) >> 8u) * LIGHT_U_STEP;
    return select(sum, sum - 1.0, sum >= 1.0);
}

// The random numbers of candidate `i`. Twin of `candidate_numbers`.
fn light_candidate_numbers(u: vec4<f32>, i: u32, count: u32) -> vec4<f32> {
    if count == 1u {
        return u;
    }
    // Multiplies by 2^24, which is exact; a quotient need not be.
    let fixed_point = u32(light_clamp_unit(u.x) * 16777216.0);
    return vec4(
        f32(((i << 24u) + fixed_point) / count) * LIGHT_U_STEP,
        light_shifted(u.y, i, LIGHT_LATTICE_Y),
        light_shifted(u.z, i, LIGHT_LATTICE_Z),
        light_shifted(u.w, i, LIGHT_LATTICE_W),
    );
}

// The unshadowed illuminance by a candidate in lux, times the reflectance of a glossy surface and
// divided by its probability density. Twin of `illuminance_weight`.
fn light_illuminance_weight(shading_point: LightShadingPoint, candidate: LightSample) -> f32 {
    var cosine = 1.0;
    if any(shading_point.normal != vec3(0.0)) {
        cosine = dot(shading_point.normal, candidate.direction);
    }
    var lux = dot(candidate.radiance, vec3(0.2126, 0.7152, 0.0722)) * cosine;
    // #if GLOSSY
    if lux > 0.0 {
        lux *= light_reflectance(shading_point.gloss, candidate.direction, cosine);
    }
    // #endif
    return light_clamp_weight(lux / candidate.pdf / candidate.pmf);
}

// Clamps to [LIGHT_MIN_WEIGHT, LIGHT_MAX_WEIGHT]; NaN becomes the least.
fn light_clamp_weight(weight: f32) -> f32 {
    return min(select(LIGHT_MIN_WEIGHT, weight, weight > LIGHT_MIN_WEIGHT), LIGHT_MAX_WEIGHT);
}

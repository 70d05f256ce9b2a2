// Several candidates for one sample. Twin of src/resample.rs, which explains it.

// One of several candidates. brdf * cosine * chosen.radiance * weight estimates the light that arrives, if nothing
// stands between: `weight` is in place of 1 / (pmf * pdf).
struct LightReservoir {
    // The candidate that was kept, with its own pmf and pdf; its pmf is 0 if none brings anything.
    chosen: LightSample,
    // Steradians for surfaces, a number for lights without size; 0 if none brings anything: count that as black.
    weight: f32,
}

// A number moved along a lattice, back into [0, 1).
fn light_moved(u: f32, i: u32, step: u32) -> f32 {
    let sum = light_clamp_unit(u) + f32((i * step) >> 8u) * LIGHT_U_STEP;
    return select(sum, sum - 1.0, sum >= 1.0);
}

// The random numbers of a candidate. Twin of `numbers`.
fn light_numbers(u: vec4<f32>, i: u32, count: u32) -> vec4<f32> {
    if count == 1u {
        return u;
    }
    // 2^24 is exact where a quotient need not be.
    let fixed = u32(light_clamp_unit(u.x) * 16777216.0);
    return vec4(
        f32(((i << 24u) + fixed) / count) * LIGHT_U_STEP,
        light_moved(u.y, i, LIGHT_LATTICE_Y),
        light_moved(u.z, i, LIGHT_LATTICE_Z),
        light_moved(u.w, i, LIGHT_LATTICE_W),
    );
}

// What a candidate would bring without shadows, in lux, over the chance of it. Twin of `weigh`.
fn light_weigh(shading_point: LightShadingPoint, candidate: LightSample) -> f32 {
    var cosine = 1.0;
    if any(shading_point.normal != vec3(0.0)) {
        cosine = dot(shading_point.normal, candidate.direction);
    }
    let lux = dot(candidate.radiance, vec3(0.2126, 0.7152, 0.0722)) * cosine;
    let weight = lux / candidate.pdf / candidate.pmf;
    return min(select(LIGHT_MIN_WEIGHT, weight, weight > LIGHT_MIN_WEIGHT), LIGHT_MAX_WEIGHT);
}

// Chooses one of several candidates, in proportion to the light that each would bring without shadows. `u` in [0, 1) as
// for light_sample, which this equals for one candidate; `candidates` counts as 1 below, as LIGHT_MAX_CANDIDATES
// above.
fn light_resample(shading_point: LightShadingPoint, u: vec4<f32>, candidates: u32) -> LightReservoir {
    let count = clamp(candidates, 1u, LIGHT_MAX_CANDIDATES);
    var cut: LightCut;
    light_open(&cut, shading_point);
    var directional = 0.0;
    // #if DIRECTIONAL
    directional = light_directional(shading_point);
    // #endif
    let bits = bitcast<vec4<u32>>(u);
    var state = light_hash(bits.x ^ light_hash(bits.y ^ light_hash(bits.z ^ light_hash(bits.w))));
    var kept = LightSample(vec3(0.0), 0.0, vec3(0.0), 0.0, 0.0, 0u, 0u, 0u);
    var kept_weight = 0.0;
    var total = 0.0;
    for (var i = 0u; i < count; i++) {
        state = light_hash(state);
        let own = light_numbers(u, i, count);
        let candidate = light_sample_picked(shading_point, light_draw(&cut, directional, shading_point, own.xy), own.zw);
        if candidate.pmf <= 0.0 {
            continue;
        }
        let weight = light_weigh(shading_point, candidate);
        total += weight;
        if kept_weight <= 0.0 || f32(state >> 8u) * LIGHT_U_STEP * total < weight {
            kept = candidate;
            kept_weight = weight;
        }
    }
    if kept_weight <= 0.0 {
        return LightReservoir(kept, 0.0);
    }
    let density = max(kept.pmf * kept.pdf, LIGHT_MIN_PDF);
    return LightReservoir(kept, total / (f32(count) * kept_weight) / density);
}

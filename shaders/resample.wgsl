// Chooses one of several candidates. Twin of src/resample.rs, which explains it.

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

// The unshadowed illuminance by a candidate in lux, divided by its probability density. Twin of
// `candidate_weight`.
fn light_candidate_weight(shading_point: LightShadingPoint, candidate: LightSample) -> f32 {
    var cosine = 1.0;
    if any(shading_point.normal != vec3(0.0)) {
        cosine = dot(shading_point.normal, candidate.direction);
    }
    let lux = dot(candidate.radiance, vec3(0.2126, 0.7152, 0.0722)) * cosine;
    let weight = lux / candidate.pdf / candidate.pmf;
    return min(select(LIGHT_MIN_WEIGHT, weight, weight > LIGHT_MIN_WEIGHT), LIGHT_MAX_WEIGHT);
}

// Draws several candidates and chooses one of them in proportion to its unshadowed light. `u` in
// [0, 1) as for light_sample, which this equals for one candidate. `candidates` is clamped to 1 and
// LIGHT_MAX_CANDIDATES.
fn light_resample(shading_point: LightShadingPoint, u: vec4<f32>, candidates: u32) -> LightReservoir {
    let count = clamp(candidates, 1u, LIGHT_MAX_CANDIDATES);
    var directional_lux = 0.0;
    // #if DIRECTIONAL
    directional_lux = light_directional_lux(shading_point);
    // #endif
    var cut: LightCut;
    light_new_cut(&cut, directional_lux, shading_point);
    let bits = bitcast<vec4<u32>>(u);
    var state = light_hash(bits.x ^ light_hash(bits.y ^ light_hash(bits.z ^ light_hash(bits.w))));
    var kept = LightSample(vec3(0.0), 0.0, vec3(0.0), 0.0, 0.0, 0u, 0u, 0u);
    var kept_weight = 0.0;
    var total = 0.0;
    for (var i = 0u; i < count; i++) {
        state = light_hash(state);
        let numbers = light_candidate_numbers(u, i, count);
        let pick = light_draw(&cut, directional_lux, shading_point, numbers.xy);
        let candidate = light_sample_picked(shading_point, pick, numbers.zw);
        if candidate.pmf <= 0.0 {
            continue;
        }
        let weight = light_candidate_weight(shading_point, candidate);
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

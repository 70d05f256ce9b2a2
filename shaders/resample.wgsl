// Several candidates for one sample. Twin of src/resample.rs, which explains it.

// One of several candidates. brdf * cosine * sample.radiance * weight estimates the light that arrives, if nothing
// stands between: `weight` is in place of 1 / (pmf * pdf).
struct LightResampled {
    // The candidate that was kept, with its own pmf and pdf; its pmf is 0 if none brings anything.
    sample: LightSample,
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
fn light_weigh(receiver: LightReceiver, sample: LightSample) -> f32 {
    var cosine = 1.0;
    if any(receiver.normal != vec3(0.0)) {
        cosine = dot(receiver.normal, sample.direction);
    }
    let lux = dot(sample.radiance, vec3(0.2126, 0.7152, 0.0722)) * cosine;
    let weight = lux / sample.pdf / sample.pmf;
    return min(select(LIGHT_LEAST_WEIGHT, weight, weight > LIGHT_LEAST_WEIGHT), LIGHT_MOST_WEIGHT);
}

// Chooses one of several candidates, in proportion to the light that each would bring without shadows. `u` in [0, 1) as
// for light_sample, which this equals for one candidate; `candidates` counts as 1 below, as LIGHT_MOST_CANDIDATES
// above.
fn light_resample(receiver: LightReceiver, u: vec4<f32>, candidates: u32) -> LightResampled {
    let count = clamp(candidates, 1u, LIGHT_MOST_CANDIDATES);
    var cut: LightCut;
    light_open(&cut, receiver);
    var directional = 0.0;
    // #if DIRECTIONAL
    directional = light_directional(receiver);
    // #endif
    let bits = bitcast<vec4<u32>>(u);
    var state = light_hash(bits.x ^ light_hash(bits.y ^ light_hash(bits.z ^ light_hash(bits.w))));
    var kept = LightSample(vec3(0.0), 0.0, vec3(0.0), 0.0, 0.0, 0u, 0u, 0u);
    var kept_weight = 0.0;
    var total = 0.0;
    for (var i = 0u; i < count; i++) {
        state = light_hash(state);
        let own = light_numbers(u, i, count);
        let sample = light_sample_picked(receiver, light_draw(&cut, directional, receiver, own.xy), own.zw);
        if sample.pmf <= 0.0 {
            continue;
        }
        let weight = light_weigh(receiver, sample);
        total += weight;
        if kept_weight <= 0.0 || f32(state >> 8u) * LIGHT_U_STEP * total < weight {
            kept = sample;
            kept_weight = weight;
        }
    }
    if kept_weight <= 0.0 {
        return LightResampled(kept, 0.0);
    }
    let density = max(kept.pmf * kept.pdf, LIGHT_LEAST_PDF);
    return LightResampled(kept, total / (f32(count) * kept_weight) / density);
}


// The light of a sample that arrives and is reflected, before division by its probability.
fn girandole_arriving(surface: LightingInput, light: LightSample) -> vec3<f32> {
    let reflected = girandole_reflected(surface, light);
    if all(reflected == vec3(0.0)) || !girandole_is_seen(surface, light) {
        return vec3(0.0);
    }
    return reflected;
}

// The sum over all lights. One point is drawn on each light with a surface.
fn girandole_all(surface: LightingInput, seed: u32) -> vec3<f32> {
    let at = girandole_shading_point(surface);
    var sum = vec3(0.0);
    for (var i = 0u; i < girandole_view.directionals; i++) {
        sum += girandole_arriving(surface, light_sample_picked(at, LightPick(LIGHT_DIRECTIONAL, i, 1.0), vec2(0.5)));
    }
    for (var slot = 0u; slot < girandole_view.slots; slot++) {
        let kind = light_user_data(slot);
        if kind == 0u {
            continue;
        }
        for (var i = 0u; i < girandole_kinds[kind].lights; i++) {
            let numbers = girandole_numbers(seed ^ light_hash(slot ^ light_hash(i)));
            let light = light_sample_picked(at, LightPick(slot, i, 1.0), numbers.u.xy);
            if light.pmf > 0.0 {
                sum += girandole_arriving(surface, light) / light.pdf;
            }
        }
    }
    return sum;
}

// The light that a pixel reflects, from one frame.
fn girandole_estimate(surface: LightingInput, seed: u32) -> vec3<f32> {
    if girandole_view.is_exhaustive != 0u {
        return girandole_all(surface, seed);
    }
    var sum = vec3(0.0);
    for (var i = 0u; i < girandole_view.samples; i++) {
        sum += girandole_sample(surface, girandole_view.candidates, light_hash(seed + i));
    }
    return sum / f32(max(girandole_view.samples, 1u));
}


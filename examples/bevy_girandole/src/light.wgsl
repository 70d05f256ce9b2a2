
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
        let light = light_reservoir_sample(at, light_reservoir_of(LIGHT_DIRECTIONAL, i, vec2(0.5)));
        sum += girandole_arriving(surface, light);
    }
    for (var slot = 0u; slot < girandole_view.slots; slot++) {
        let kind = light_user_data(slot);
        if kind == 0u {
            continue;
        }
        for (var i = 0u; i < girandole_kinds[kind].lights; i++) {
            let numbers = girandole_numbers(seed ^ light_hash(slot ^ light_hash(i)));
            let light = light_reservoir_sample(at, light_reservoir_of(slot, i, numbers.u.xy));
            if light.pmf > 0.0 {
                sum += girandole_arriving(surface, light) / light.pdf;
            }
        }
    }
    return sum;
}

// By what lights are kept: the luminance that a sample brings to a surface without shadows.
fn girandole_target(surface: LightingInput, light: LightSample) -> f32 {
    if light.pmf <= 0.0 {
        return 0.0;
    }
    return dot(girandole_reflected(surface, light), vec3(0.2126, 0.7152, 0.0722)) / light.pdf;
}

// The same with shadows.
fn girandole_lit(surface: LightingInput, light: LightSample) -> f32 {
    let unshadowed = girandole_target(surface, light);
    if unshadowed <= 0.0 || !girandole_is_seen(surface, light) {
        return 0.0;
    }
    return unshadowed;
}

// New samples of a pixel, of which one is kept.
fn girandole_drawn(surface: LightingInput, seed: u32) -> LightReservoir {
    let at = girandole_shading_point(surface);
    var kept = LightReservoir();
    for (var i = 0u; i < girandole_view.samples; i++) {
        let numbers = girandole_numbers(light_hash(seed + i));
        var own = light_resample(at, numbers.u, numbers.choice, girandole_view.candidates);
        let light = light_reservoir_sample(at, own);
        own.reflected = girandole_target(surface, light);
        if own.reflected > 0.0 {
            let is_seen = girandole_is_seen(surface, light);
            girandole_note(at, light, is_seen, numbers.bits);
            own.reflected = select(0.0, own.reflected, is_seen);
        }
        kept = light_reservoir_merge(kept, kept.reflected, own, own.reflected, numbers.more);
    }
    return kept;
}

// What a pixel at `place` has kept in the frame before, where its surface was; none if it was not in view. The surfaces of
// both frames count as one: what the light reflected then is computed for the present surface.
fn girandole_kept_before(place: vec2<i32>, surface: LightingInput) -> LightReservoir {
    let motion_uv = textureLoad(mesh_view_bindings::motion_vector_prepass_texture, place, 0).xy;
    let before = vec2<i32>(floor(vec2<f32>(place) + 0.5 - motion_uv * mesh_view_bindings::view.viewport.zw));
    if any(before < vec2(0)) || any(before >= vec2<i32>(textureDimensions(girandole_past_dist))) {
        return LightReservoir();
    }
    let dist = distance(mesh_view_bindings::view.world_position, surface.P);
    if abs(textureLoad(girandole_past_dist, before, 0).x - dist) > GIRANDOLE_SAME_DIST * dist {
        return LightReservoir();
    }
    var kept = girandole_past_kept[u32(before.y) * girandole_view.width + u32(before.x)];
    kept.count = min(kept.count, f32(girandole_view.reused_frames * max(girandole_view.samples, 1u)));
    if kept.reflected > 0.0 {
        let at = girandole_shading_point(surface);
        kept.reflected = girandole_target(surface, light_reservoir_sample_previous(at, kept));
    }
    return kept;
}

// Merges what a surface has kept in the frame before.
fn girandole_merged(
    own: LightReservoir, surface: LightingInput, then: LightReservoir, surface_then: LightingInput, u: f32,
) -> LightReservoir {
    let at_then = girandole_shading_point(surface_then);
    var own_there = girandole_target(surface_then, light_reservoir_sample_previous(at_then, own));
    // The ray ends where the light is now: where it was, its own housing may be by now.
    if own_there > 0.0 && !girandole_is_seen(surface_then, light_reservoir_sample(at_then, own)) {
        own_there = 0.0;
    }
    let here = girandole_lit(surface, light_reservoir_sample(girandole_shading_point(surface), then));
    return light_reservoir_merge(own, own_there, then, here, u);
}

// The light that a pixel reflects, from one frame.
fn girandole_estimate(surface: LightingInput, texel: vec2<i32>, seed: u32) -> vec3<f32> {
    if girandole_view.is_exhaustive != 0u {
        return girandole_all(surface, seed);
    }
    var kept = girandole_drawn(surface, seed);
    let reuses = girandole_view.has_history != 0u && girandole_view.samples > 0u;
    for (var i = 0u; i < 2u && reuses && girandole_view.reused_frames > 0u; i++) {
        // This pixel, then a neighbour.
        let numbers = girandole_numbers(light_hash(seed - 1u - i));
        let offset = vec2<i32>(round(30.0 * numbers.u.xy - 15.0)) * i32(i);
        let place = clamp(texel + offset, vec2(0), vec2<i32>(textureDimensions(girandole_past_dist)) - 1);
        var beside = surface;
        if i > 0u {
            let shown = girandole_pixel(vec4(vec2<f32>(place) + 0.5, 0.0, 1.0));
            let layer = shown.surface.layers[lighting::LAYER_BASE];
            let is_alike = dot(layer.N, surface.layers[lighting::LAYER_BASE].N) > GIRANDOLE_SAME_COSINE
                && abs(dot(shown.surface.P - surface.P, layer.N)) < GIRANDOLE_SAME_PLANE * distance(mesh_view_bindings::view.world_position, surface.P);
            if !shown.is_lit || !is_alike {
                continue;
            }
            beside = shown.surface;
        }
        let then = girandole_kept_before(place, beside);
        if then.count > 0.0 {
            kept = girandole_merged(kept, surface, then, beside, numbers.choice);
        }
    }
    if girandole_view.reused_frames > 0u {
        girandole_kept[u32(texel.y) * girandole_view.width + u32(texel.x)] = kept;
    }
    if girandole_view.shows_history != 0u {
        let fresh = f32(girandole_view.samples);
        let most = max(2.0 * f32(girandole_view.reused_frames) * fresh, 1.0);
        return vec3((kept.count - fresh) / most / mesh_view_bindings::view.exposure);
    }
    let light = light_reservoir_sample(girandole_shading_point(surface), kept);
    if light.pmf <= 0.0 || kept.reflected <= 0.0 {
        return vec3(0.0);
    }
    return girandole_reflected(surface, light) / (light.pmf * light.pdf);
}

// The functions that an engine calls: they choose a light for a shading point, and return the
// probability of a light. Twin of src/sampling/sample.rs. The caller of `girandole::gpu::wgsl`
// chooses the group of the bindings.

@group(LIGHT_GROUP) @binding(0) var<uniform> light_params: LightParams;
@group(LIGHT_GROUP) @binding(1) var<storage, read> light_top: array<vec4<u32>>;
@group(LIGHT_GROUP) @binding(2) var<storage, read> light_nodes: array<vec4<u32>>;
@group(LIGHT_GROUP) @binding(3) var<storage, read> light_instances: array<vec4<u32>>;
@group(LIGHT_GROUP) @binding(4) var<storage, read> light_records: array<vec4<u32>>;

// A light and a point on it that light_sample chose. brdf * cosine * radiance / (pmf * pdf)
// estimates the light that arrives from all lights, if the point is not in shadow.
struct LightSample {
    // Unit vector from the shading point to the point on the light.
    direction: vec3<f32>,
    // Distance in metres; 1e18 for a directional light.
    dist: f32,
    // Radiance in nits for surfaces; for lights without size the illuminance, in lux, of a surface
    // that faces them.
    radiance: vec3<f32>,
    // Density per steradian for surfaces, 1 for lights without size.
    pdf: f32,
    // The probability of this light; of a reservoir 1 / weight in its place. 0 if no light can reach the
    // shading point, or if the chosen point sends nothing to it: count that as black.
    pmf: f32,
    // The slot of the instance, or 0xffffffff for a directional light.
    instance: u32,
    // The light's index in the tree, or among the directional lights.
    light: u32,
    // 1 for a light without size, which rays cannot hit.
    is_delta: u32,
}

// A light that light_pick chose; the fields are as in LightSample.
struct LightPick {
    instance: u32,
    light: u32,
    // 0 if no light can reach the shading point.
    pmf: f32,
}

// #if DIRECTIONAL
// What a directional light is chosen by: its illuminance at a shading point, as luminance in lux,
// times the reflectance of a glossy surface.
fn light_illuminance(index: u32, shading_point: LightShadingPoint) -> f32 {
    let light = light_record(light_params.directional_base + index);
    var cosine = 1.0;
    if any(shading_point.normal != vec3(0.0)) {
        cosine = -dot(shading_point.normal, light.b);
    }
    // At most 1, whatever the length of the normal is.
    var lux = dot(light.emission, vec3(0.2126, 0.7152, 0.0722)) * select(0.0, min(cosine, 1.0), cosine > 0.0);
    // #if GLOSSY
    if lux > 0.0 {
        lux *= light_reflectance(shading_point.gloss, -light.b, cosine);
    }
    // #endif
    return lux;
}

// The illuminance by all directional lights, and that by one of them, in lux; 0 for one that is not there.
fn light_directional_lux_of(shading_point: LightShadingPoint, light: u32) -> vec2<f32> {
    var sums = vec2(0.0);
    for (var i = 0u; i < light_params.directional_count; i++) {
        let lux = light_illuminance(i, shading_point);
        sums += vec2(lux, select(0.0, lux, i == light));
    }
    return sums;
}

// The illuminance by all directional lights, in lux.
fn light_directional_lux(shading_point: LightShadingPoint) -> f32 {
    return light_directional_lux_of(shading_point, LIGHT_NO_LIGHT).x;
}

// The directional light at a point of the line from 0 to the illuminance by all of them. `total`
// includes the trees.
fn light_pick_directional(shading_point: LightShadingPoint, point: f32, total: f32) -> LightPick {
    var pick = LightPick(LIGHT_DIRECTIONAL, 0u, 0.0);
    var before = 0.0;
    for (var i = 0u; i < light_params.directional_count; i++) {
        let lux = light_illuminance(i, shading_point);
        if lux > 0.0 && point >= before {
            pick = LightPick(LIGHT_DIRECTIONAL, i, light_choice_pmf(lux, total));
        }
        before += lux;
    }
    return pick;
}
// #endif

// Chooses a light, without a point on it. `u` in [0, 1).
fn light_pick(shading_point: LightShadingPoint, u: vec2<f32>) -> LightPick {
    var directional_lux = 0.0;
    // #if DIRECTIONAL
    directional_lux = light_directional_lux(shading_point);
    // #endif
    var cut: LightCut;
    light_new_cut(&cut, directional_lux, shading_point);
    return light_draw(&cut, directional_lux, shading_point, u);
}

// Chooses one of a cut's lights, or a directional light; those bring `directional_lux` together.
// Twin of `draw`.
fn light_draw(
    cut: ptr<function, LightCut>, directional_lux: f32, shading_point: LightShadingPoint, u: vec2<f32>,
) -> LightPick {
    var outer = light_dice(u.x, u.y);
    var pmf = 1.0;
    // #if DIRECTIONAL
    if directional_lux > 0.0 {
        let total = (*cut).total + directional_lux;
        let point = outer.u * total;
        if point >= (*cut).total {
            return light_pick_directional(shading_point, point - (*cut).total, total);
        }
        pmf = light_choice_pmf((*cut).total, total);
        outer = light_remap(outer, point / total, pmf);
    }
    // #endif
    let pick = light_descend(cut, shading_point, outer, light_dice(u.y, u.x));
    return LightPick(pick.instance, pick.light, light_joint_pmf(pmf, pick.pmf));
}

// Returns the probability with which light_pick and light_sample choose a light; 0 for one that is not there.
// `instance` is the slot of its instance, or 0xffffffff for directional lights.
fn light_pmf(shading_point: LightShadingPoint, instance: u32, light: u32) -> f32 {
    var directional_lux = 0.0;
    // #if DIRECTIONAL
    let lux = light_directional_lux_of(shading_point, light);
    directional_lux = lux.x;
    // #endif
    var cut: LightCut;
    light_new_cut(&cut, directional_lux, shading_point);
    var pmf = 1.0;
    // #if DIRECTIONAL
    let total = cut.total + directional_lux;
    if instance == LIGHT_DIRECTIONAL {
        return light_choice_pmf(lux.y, total);
    }
    if directional_lux > 0.0 {
        pmf = light_choice_pmf(cut.total, total);
    }
    // #endif
    if cut.total <= 0.0 {
        return 0.0;
    }
    return light_joint_pmf(pmf, light_climb(&cut, shading_point, instance, light));
}

// Chooses a light and a point on it. `u` in [0, 1): two numbers choose the light, two the point.
fn light_sample(shading_point: LightShadingPoint, u: vec4<f32>) -> LightSample {
    return light_sample_drawn(shading_point, light_pick(shading_point, u.xy), u.zw);
}

// #if FACTORS
// What arrives from a light of an instance with a factor. `slot` is LIGHT_DIRECTIONAL for a light
// without an instance. Twin of `Appearance::arriving`.
fn light_factored(incident: LightIncident, slot: u32, instance: LightInstance) -> LightIncident {
    var factored = incident;
    if slot != LIGHT_DIRECTIONAL {
        let factor = instance.factor;
        let limit = LIGHT_MAX_FINITE / max(max(factor.x, factor.y), max(factor.z, 1.0));
        let is_finite = all(incident.radiance <= vec3(limit));
        factored.radiance = select(vec3(0.0), incident.radiance * factor, is_finite);
    }
    return factored;
}
// #endif

// Chooses a point on a light that was picked. A pick with a pmf above 0 names a light that is there.
fn light_sample_drawn(shading_point: LightShadingPoint, pick: LightPick, u: vec2<f32>) -> LightSample {
    var seen_from = shading_point;
    var numbers = u;
    var is_none = pick.pmf <= 0.0;
    // #if SEGMENTS
    // A point of the segment, and the density of its distance. Twin of `LightSampler::sample_light_along`.
    var chosen = LightAlong(0.0, 1.0);
    let is_segment = light_is_segment(shading_point) && !is_none;
    if is_segment {
        let stretch = light_stretch_of(shading_point, pick.instance, pick.light);
        chosen = light_stretch_sample(stretch, light_clamp_unit(u.x));
        is_none = chosen.pdf <= 0.0;
        light_along = chosen.along;
        seen_from = light_point_along(shading_point, chosen.along);
        numbers = vec2(u.y, f32(light_hash_both(u.x, u.y) >> 8u) * LIGHT_U_STEP);
    }
    // #endif
    if is_none {
        return LightSample(vec3(0.0), 0.0, vec3(0.0), 0.0, 0.0, 0u, 0u, 0u);
    }
    var slot = pick.instance;
    // #if DIRECTIONAL
    let is_directional = pick.instance == LIGHT_DIRECTIONAL;
    slot = select(slot, 0u, is_directional);
    // #endif
    let instance = light_instance(slot);
    var base = instance.light_base;
    // #if DIRECTIONAL
    base = select(base, light_params.directional_base, is_directional);
    // #endif
    var incident = light_incident(light_record(base + pick.light), instance, seen_from, numbers);
    // #if FACTORS
    incident = light_factored(incident, pick.instance, instance);
    // #endif
    // #if MASKS
    if pick.instance != LIGHT_DIRECTIONAL && (instance.mask & shading_point.mask) == 0u {
        incident = light_nothing();
    }
    // #endif
    var pdf = incident.pdf;
    // #if SEGMENTS
    pdf = select(pdf, clamp(pdf * chosen.pdf, LIGHT_MIN_PDF, LIGHT_MAX_DENSITY), is_segment);
    // #endif
    let pmf = select(0.0, pick.pmf, any(incident.radiance != vec3(0.0)));
    return LightSample(
        incident.direction, incident.dist, incident.radiance, pdf,
        pmf, pick.instance, pick.light, select(0u, 1u, incident.is_delta),
    );
}

// What an engine calls: choose a light for a shading point, and ask for a light's chance. Twin of src/sample.rs. The bindings sit in the group that `girandole::gpu::wgsl` was asked for.

@group(LIGHT_GROUP) @binding(0) var<uniform> light_params: LightParams;
@group(LIGHT_GROUP) @binding(1) var<storage, read> light_top: array<vec4<u32>>;
@group(LIGHT_GROUP) @binding(2) var<storage, read> light_nodes: array<vec4<u32>>;
@group(LIGHT_GROUP) @binding(3) var<storage, read> light_instances: array<vec4<u32>>;
@group(LIGHT_GROUP) @binding(4) var<storage, read> light_records: array<vec4<u32>>;

// A chosen light and a point on it. Its share of what arrives is estimated by
// brdf * cosine * radiance / (pmf * pdf), if nothing stands between.
struct LightSample {
    // Unit vector from the shading point to the light.
    direction: vec3<f32>,
    // Metres; 1e18 for a directional light.
    dist: f32,
    // Nits for surfaces; for lights without size the illuminance in lux of a surface that faces them.
    radiance: vec3<f32>,
    // Per steradian for surfaces, 1 for lights without size.
    pdf: f32,
    // The chance of this light; 0 if there is none, or if the chosen point sends nothing: count that as black.
    pmf: f32,
    // The instance's slot, or 0xffffffff for a directional light.
    instance: u32,
    // Its index in the tree, or among the directional lights.
    light: u32,
    // 1 for a light without size: there is nothing to hit.
    is_delta: u32,
}

struct LightPick {
    instance: u32,
    light: u32,
    // 0 if there is none.
    pmf: f32,
}

// #if DIRECTIONAL
// Luminance in lux of a directional light at a shading point.
fn light_illuminance(index: u32, shading_point: LightShadingPoint) -> f32 {
    let light = light_record(light_params.directional_base + index);
    var cosine = 1.0;
    if any(shading_point.normal != vec3(0.0)) {
        cosine = -dot(shading_point.normal, light.b);
    }
    return dot(light.emission, vec3(0.2126, 0.7152, 0.0722)) * max(cosine, 0.0);
}

// Illuminance by all directional lights, in lux.
fn light_directional(shading_point: LightShadingPoint) -> f32 {
    var sum = 0.0;
    for (var i = 0u; i < light_params.directional_count; i++) {
        sum += light_illuminance(i, shading_point);
    }
    return sum;
}

fn light_pick_directional(shading_point: LightShadingPoint, point: f32, total: f32) -> LightPick {
    var pick = LightPick(LIGHT_DIRECTIONAL, 0u, 0.0);
    var before = 0.0;
    for (var i = 0u; i < light_params.directional_count; i++) {
        let value = light_illuminance(i, shading_point);
        if value > 0.0 && point >= before {
            pick = LightPick(LIGHT_DIRECTIONAL, i, light_share(value, total));
        }
        before += value;
    }
    return pick;
}
// #endif

// Chooses a light. `u` in [0, 1).
fn light_pick(shading_point: LightShadingPoint, u: vec2<f32>) -> LightPick {
    var cut: LightCut;
    light_open(&cut, shading_point);
    var directional = 0.0;
    // #if DIRECTIONAL
    directional = light_directional(shading_point);
    // #endif
    return light_draw(&cut, directional, shading_point, u);
}

// Chooses one of a cut's lights, or a directional one; those bring `directional` lux. Twin of `Cut::draw`.
fn light_draw(cut: ptr<function, LightCut>, directional: f32, shading_point: LightShadingPoint, u: vec2<f32>) -> LightPick {
    var dice = light_dice(u.x, u.y);
    var chance = 1.0;
    // #if DIRECTIONAL
    if directional > 0.0 {
        let total = (*cut).total + directional;
        let point = dice.u * total;
        if point >= (*cut).total {
            return light_pick_directional(shading_point, point - (*cut).total, total);
        }
        chance = light_share((*cut).total, total);
        dice = light_stretch(dice, point / total, chance);
    }
    // #endif
    let pick = light_descend(cut, shading_point, dice, light_dice(u.y, u.x));
    return LightPick(pick.instance, pick.light, light_joint(chance, pick.pmf));
}

// The chance that light_sample chooses this light; `instance` is 0xffffffff for directional lights.
fn light_pmf(shading_point: LightShadingPoint, instance: u32, light: u32) -> f32 {
    var cut: LightCut;
    light_open(&cut, shading_point);
    var chance = 1.0;
    // #if DIRECTIONAL
    let directional = light_directional(shading_point);
    let total = cut.total + directional;
    if instance == LIGHT_DIRECTIONAL {
        return light_share(light_illuminance(light, shading_point), total);
    }
    if directional > 0.0 {
        chance = light_share(cut.total, total);
    }
    // #endif
    if cut.total <= 0.0 {
        return 0.0;
    }
    return light_joint(chance, light_climb(&cut, shading_point, instance, light));
}

// Chooses a light and a point on it. `u` in [0, 1): two numbers choose the light, two the point.
fn light_sample(shading_point: LightShadingPoint, u: vec4<f32>) -> LightSample {
    return light_sample_picked(shading_point, light_pick(shading_point, u.xy), u.zw);
}

// A point on a light that was picked.
fn light_sample_picked(shading_point: LightShadingPoint, pick: LightPick, u: vec2<f32>) -> LightSample {
    if pick.pmf <= 0.0 {
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
    let incident = light_incident(light_record(base + pick.light), instance, shading_point, u);
    let pmf = select(0.0, pick.pmf, any(incident.radiance != vec3(0.0)));
    return LightSample(
        incident.direction, incident.dist, incident.radiance, incident.pdf,
        pmf, pick.instance, pick.light, select(0u, 1u, incident.is_delta),
    );
}

// What an engine calls: choose a light for a receiver, and ask for a light's chance. Twin of src/walk.rs and
// src/sample.rs. The bindings sit in the group that `girandole::gpu::wgsl` was asked for.

@group(LIGHT_GROUP) @binding(0) var<uniform> light_params: LightParams;
@group(LIGHT_GROUP) @binding(1) var<storage, read> light_top: array<LightNode>;
@group(LIGHT_GROUP) @binding(2) var<storage, read> light_nodes: array<LightNode>;
@group(LIGHT_GROUP) @binding(3) var<storage, read> light_instances: array<LightInstance>;
@group(LIGHT_GROUP) @binding(4) var<storage, read> light_records: array<LightRecord>;

// A chosen light and a point on it. Its share of what arrives is estimated by
// brdf * cosine * radiance / (pmf * pdf), if nothing stands between.
struct LightSample {
    // Unit vector from the receiver to the light.
    direction: vec3<f32>,
    // Metres; 1e18 for a directional light.
    distance: f32,
    // Nits for surfaces; for lights without size the illuminance in lux of a surface that faces them.
    radiance: vec3<f32>,
    // Per steradian for surfaces, 1 for lights without size.
    pdf: f32,
    // The chance of this light; 0 if there is none, or if the chosen point sends nothing: count that as black.
    pmf: f32,
    // The instance's slot, or LIGHT_DIRECTIONAL.
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

// A leaf and the chance of getting there.
struct LightLeaf {
    index: u32,
    pmf: f32,
}

struct LightImportances {
    each: array<f32, LIGHT_WIDTH>,
    total: f32,
}

fn light_importances(in_top: bool, node: u32, view: LightView) -> LightImportances {
    var all: LightImportances;
    var count: u32;
    if in_top { count = light_top[node].count; } else { count = light_nodes[node].count; }
    for (var slot = 0u; slot < count; slot++) {
        var child: LightChild;
        if in_top { child = light_top[node].children[slot]; } else { child = light_nodes[node].children[slot]; }
        let value = light_importance(child, view);
        all.each[slot] = value;
        all.total += value;
    }
    return all;
}

// Walks down from the root to a leaf; `base` is the root's index in its buffer.
fn light_descend(in_top: bool, base: u32, view: LightView, first_dice: LightDice) -> LightLeaf {
    var dice = first_dice;
    var node = base;
    var pmf = 1.0;
    loop {
        var all = light_importances(in_top, node, view);
        if all.total <= 0.0 {
            return LightLeaf(0u, 0.0);
        }
        let point = dice.u * all.total;
        var before = 0.0;
        var chosen = 0u;
        var chosen_before = 0.0;
        for (var slot = 0u; slot < LIGHT_WIDTH; slot++) {
            if all.each[slot] > 0.0 && point >= before {
                chosen = slot;
                chosen_before = before;
            }
            before += all.each[slot];
        }
        let share = light_share(all.each[chosen], all.total);
        pmf = light_joint(pmf, share);
        dice = light_stretch(dice, (point - chosen_before) / all.total, share);
        var bits: u32;
        if in_top { bits = light_top[node].children[chosen].target_bits; } else { bits = light_nodes[node].children[chosen].target_bits; }
        if (bits & LIGHT_LEAF) != 0u {
            return LightLeaf(bits & ~LIGHT_LEAF, pmf);
        }
        node = base + bits;
    }
    return LightLeaf(0u, 0.0);
}

// The chance that light_descend ends at the leaf in `place`.
fn light_ascend(in_top: bool, base: u32, view: LightView, leaf_place: u32) -> f32 {
    var place = leaf_place;
    var pmf = 1.0;
    loop {
        let node = base + place / LIGHT_WIDTH;
        var all = light_importances(in_top, node, view);
        let value = all.each[place % LIGHT_WIDTH];
        if value <= 0.0 {
            return 0.0;
        }
        pmf = light_joint(pmf, light_share(value, all.total));
        if in_top { place = light_top[node].parent; } else { place = light_nodes[node].parent; }
        if place == LIGHT_NO_PARENT {
            return pmf;
        }
    }
    return pmf;
}

// A receiver seen in the top level.
fn light_view_of_world(receiver: LightReceiver) -> LightView {
    return LightView(receiver.position, light_normalize_or_zero(receiver.normal), 1.0, LIGHT_POSITION_MARGIN, true);
}

// A receiver seen in an instance's tree.
fn light_view(instance: u32, receiver: LightReceiver) -> LightView {
    let to_world = light_instances[instance].to_world;
    let to_local = light_instances[instance].to_local;
    return LightView(
        light_linear(to_local, receiver.position - light_translation(to_world)),
        light_normalize_or_zero(light_transposed(to_world, receiver.normal)),
        to_local[1].w,
        LIGHT_POSITION_MARGIN * max(sqrt(to_local[2].w) * to_local[1].w, 1.0),
        (light_instances[instance].flags & LIGHT_KEEPS_ANGLES) != 0u,
    );
}

// Luminance in lux of a directional light at a receiver.
fn light_illuminance(index: u32, receiver: LightReceiver) -> f32 {
    let record = light_params.directional_base + index;
    var cosine = 1.0;
    if any(receiver.normal != vec3(0.0)) {
        cosine = -dot(receiver.normal, light_records[record].b);
    }
    return dot(light_records[record].emission, vec3(0.2126, 0.7152, 0.0722)) * max(cosine, 0.0);
}

// Estimated illuminance by the trees (1 where it decides nothing), and illuminance by directional lights.
fn light_totals(receiver: LightReceiver, view: LightView) -> vec2<f32> {
    var directional = 0.0;
    for (var i = 0u; i < light_params.directional_count; i++) {
        directional += light_illuminance(i, receiver);
    }
    if directional <= 0.0 {
        return vec2(1.0, 0.0);
    }
    return vec2(light_importances(true, 0u, view).total, directional);
}

fn light_pick_directional(receiver: LightReceiver, point: f32, total: f32) -> LightPick {
    var pick = LightPick(LIGHT_DIRECTIONAL, 0u, 0.0);
    var before = 0.0;
    for (var i = 0u; i < light_params.directional_count; i++) {
        let value = light_illuminance(i, receiver);
        if value > 0.0 && point >= before {
            pick = LightPick(LIGHT_DIRECTIONAL, i, light_share(value, total));
        }
        before += value;
    }
    return pick;
}

// Chooses a light. `u` in [0, 1).
fn light_pick(receiver: LightReceiver, u: vec2<f32>) -> LightPick {
    let none = LightPick(0u, 0u, 0.0);
    let view = light_view_of_world(receiver);
    var dice = light_dice(u.x, u.y);
    let totals = light_totals(receiver, view);
    let total = totals.x + totals.y;
    if total <= 0.0 {
        return none;
    }
    var chance = 1.0;
    if totals.y > 0.0 {
        let point = dice.u * total;
        if point >= totals.x {
            return light_pick_directional(receiver, point - totals.x, total);
        }
        chance = light_share(totals.x, total);
        dice = light_stretch(dice, point / total, chance);
    }
    let instance = light_descend(true, 0u, view, dice);
    if instance.pmf <= 0.0 {
        return none;
    }
    let inner = light_view(instance.index, receiver);
    let base = light_instances[instance.index].node_base;
    let light = light_descend(false, base, inner, light_dice(u.y, u.x));
    return LightPick(instance.index, light.index, light_joint(chance, light_joint(instance.pmf, light.pmf)));
}

// The chance that light_sample chooses this light; `instance` is LIGHT_DIRECTIONAL for directional lights.
fn light_pmf(receiver: LightReceiver, instance: u32, light: u32) -> f32 {
    let view = light_view_of_world(receiver);
    let totals = light_totals(receiver, view);
    let total = totals.x + totals.y;
    if total <= 0.0 {
        return 0.0;
    }
    if instance == LIGHT_DIRECTIONAL {
        return light_share(light_illuminance(light, receiver), total);
    }
    let chance = select(1.0, light_share(totals.x, total), totals.y > 0.0);
    let outer = light_ascend(true, 0u, view, light_instances[instance].top_place);
    if outer <= 0.0 {
        return 0.0;
    }
    let leaf = light_records[light_instances[instance].light_base + light].place;
    let inner = light_ascend(false, light_instances[instance].node_base, light_view(instance, receiver), leaf);
    return light_joint(chance, light_joint(outer, inner));
}

// Chooses a light and a point on it. `u` in [0, 1): two numbers choose the light, two the point.
fn light_sample(receiver: LightReceiver, u: vec4<f32>) -> LightSample {
    let pick = light_pick(receiver, u.xy);
    if pick.pmf <= 0.0 {
        return LightSample(vec3(0.0), 0.0, vec3(0.0), 0.0, 0.0, 0u, 0u, 0u);
    }
    let is_directional = pick.instance == LIGHT_DIRECTIONAL;
    let slot = select(pick.instance, 0u, is_directional);
    let base = select(light_instances[slot].light_base, light_params.directional_base, is_directional);
    let incident = light_incident(light_records[base + pick.light], light_instances[slot], receiver, u.zw);
    let pmf = select(0.0, pick.pmf, any(incident.radiance != vec3(0.0)));
    return LightSample(
        incident.direction, incident.distance, incident.radiance, incident.pdf,
        pmf, pick.instance, pick.light, select(0u, 1u, incident.is_delta),
    );
}

// Reservoirs: lights that are kept, and their merges. Twin of src/sampling/reservoir.rs and
// src/sampling/resample.rs, which explain them.

// A light that was kept of several, and a point on it. 28 bytes, to be stored from frame to frame. All zero: nothing
// was drawn yet.
struct LightReservoir {
    // As in LightSample.
    instance: u32,
    light: u32,
    // What light_generation returned for the light.
    generation: u32,
    // The two numbers that choose the point on the light, 16 bits each.
    numbers: u32,
    // Takes the place of 1 / pmf: the W of ReSTIR. 0 if nothing arrives.
    weight: f32,
    // How many draws it stands for: its share in a merge. 1 for one of light_resample.
    count: f32,
    // What the light reflects at the point of the reservoir: the target function of ReSTIR, which the engine sets. 0
    // in one of light_resample.
    reflected: f32,
}

fn light_packed_numbers(u: vec2<f32>) -> u32 {
    let fixed = vec2(u32(light_clamp_unit(u.x) * 65536.0), u32(light_clamp_unit(u.y) * 65536.0));
    return fixed.x | (fixed.y << 16u);
}

fn light_unpacked_numbers(numbers: u32) -> vec2<f32> {
    return (vec2<f32>(vec2(numbers & 0xffffu, numbers >> 16u)) + 0.5) * (1.0 / 65536.0);
}

// Returns a reservoir with a light that the engine names. `u` chooses the point on it. The weight is 1, and 0 for a
// light that is not there. Twin of `LightSampler::reservoir_of`.
fn light_reservoir_of(instance: u32, light: u32, u: vec2<f32>) -> LightReservoir {
    let generation = light_generation(instance, light);
    return LightReservoir(
        instance, light, generation, light_packed_numbers(u), select(0.0, 1.0, generation != 0u), 1.0, 0.0,
    );
}

// Returns the light of a reservoir at any shading point, as it is now: 1 / weight is its pmf. The pmf is 0 if nothing
// arrives, and if another light has its name. Twin of `LightSampler::reservoir_sample`.
fn light_reservoir_sample(shading_point: LightShadingPoint, reservoir: LightReservoir) -> LightSample {
    var pick = LightPick(reservoir.instance, reservoir.light, 0.0);
    if reservoir.weight > 0.0 && light_is_same(reservoir.instance, reservoir.light, reservoir.generation) {
        pick.pmf = 1.0 / reservoir.weight;
    }
    return light_sample_drawn(shading_point, pick, light_unpacked_numbers(reservoir.numbers));
}

// Returns the learnt share of rays toward a sample's light that are not blocked, in (0, 1]; 1 where nothing is learnt.
// Twin of `LightSampler::visible_share`.
fn light_visible_share(shading_point: LightShadingPoint, chosen: LightSample) -> f32 {
    var share = 1.0;
    // #if LEARNS
    share = light_place_share(light_cell(shading_point), shading_point, chosen);
    // #endif
    return share;
}

// What is reflected, if it is finite and not negative; 0 for NaN. Compares bits, since compilers may assume that no
// float is NaN.
fn light_limited_target(reflected: vec4<f32>) -> vec4<f32> {
    let bits = bitcast<vec4<u32>>(reflected);
    let is_sound = (bits >= vec4(LIGHT_TINY_BITS)) & (bits <= vec4(LIGHT_INFINITY_BITS));
    return select(vec4(0.0), min(reflected, vec4(LIGHT_MAX_TARGET)), is_sound);
}

// Merges `other` into `own`: keeps one of their lights, at the point of `own`. `own_there` is what the light of `own`
// reflects at the point of `other`, and `other_here` the reverse, each as LightReservoir::reflected. `u` in [0, 1)
// chooses. Twin of `Reservoir::merge`, which explains the shares.
fn light_reservoir_merge(
    own: LightReservoir, own_there: f32, other: LightReservoir, other_here: f32, u: f32,
) -> LightReservoir {
    let targets = light_limited_target(vec4(own.reflected, other_here, own_there, other.reflected));
    let here = targets.xy;
    let by_own = own.count * here;
    let by_other = other.count * targets.zw;
    let shares = vec2(by_own.x, by_other.y) / max(by_own + by_other, vec2(LIGHT_TINY));
    // What each brings to the sum over all lights.
    let parts = min(shares * here * vec2(own.weight, other.weight), vec2(LIGHT_MAX_TARGET));
    let total = parts.x + parts.y;
    var merged = own;
    merged.reflected = here.x;
    if light_clamp_unit(u) * total < parts.y {
        merged = other;
        merged.reflected = here.y;
    }
    merged.weight = 0.0;
    if total > 0.0 {
        merged.weight = min(total / merged.reflected, LIGHT_MAX_RESERVOIR_WEIGHT);
    }
    merged.count = own.count + other.count;
    return merged;
}

// A number shifted along a lattice, modulo 1.
fn light_shifted(u: f32, i: u32, step: u32) -> f32 {
    let sum = light_clamp_unit(u) + f32((i * step) >> 8u) * LIGHT_U_STEP;
    return select(sum, sum - 1.0, sum >= 1.0);
}

// The random numbers of candidate `i` of `candidates`, at most LIGHT_MAX_CANDIDATES. Twin of `candidate_numbers`.
fn light_candidate_numbers(u: vec4<f32>, i: u32, candidates: u32) -> vec4<f32> {
    if candidates <= 1u {
        return u;
    }
    let count = min(candidates, LIGHT_MAX_CANDIDATES);
    // Multiplies by 2^24, which is exact; a quotient need not be.
    let fixed_point = u32(light_clamp_unit(u.x) * 16777216.0);
    return vec4(
        f32(((min(i, count - 1u) << 24u) + fixed_point) / count) * LIGHT_U_STEP,
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

// Draws several candidates and keeps one in proportion to its unshadowed light. `u` in [0, 1) is as for
// light_sample; `choice` in [0, 1) chooses among the candidates. `candidates` is clamped to 1 and
// LIGHT_MAX_CANDIDATES. Twin of `LightSampler::resample`.
fn light_resample(shading_point: LightShadingPoint, u: vec4<f32>, choice: f32, candidates: u32) -> LightReservoir {
    let count = clamp(candidates, 1u, LIGHT_MAX_CANDIDATES);
    var directional_lux = 0.0;
    // #if DIRECTIONAL
    directional_lux = light_directional_lux(shading_point);
    // #endif
    // #if LEARNS
    let learnt = light_cell(shading_point);
    // #endif
    var cut: LightCut;
    light_new_cut(&cut, directional_lux, shading_point);
    var dice = light_dice(choice, u.x);
    var total = 0.0;
    var kept_weight = 0.0;
    var kept = LightPick(0u, 0u, 0.0);
    var kept_numbers = 0u;
    for (var i = 0u; i < count; i++) {
        let numbers = light_candidate_numbers(u, i, count);
        let pick = light_draw(&cut, directional_lux, shading_point, numbers.xy);
        let packed = light_packed_numbers(numbers.zw);
        var weight = select(0.0, 1.0, pick.pmf > 0.0);
        // A single candidate needs no weight.
        if count > 1u {
            let candidate = light_sample_drawn(shading_point, pick, light_unpacked_numbers(packed));
            weight = 0.0;
            if candidate.pmf > 0.0 {
                weight = light_illuminance_weight(shading_point, candidate);
                // #if LEARNS
                weight *= light_place_share(learnt, shading_point, candidate);
                // #endif
            }
        }
        if weight > 0.0 {
            total += weight;
            let share = weight / total;
            let is_kept = dice.u < share;
            dice = light_remap(dice, dice.u - select(share, 0.0, is_kept), select(1.0 - share, share, is_kept));
            if is_kept {
                kept = pick;
                kept_weight = weight;
                kept_numbers = packed;
            }
        }
    }
    if total <= 0.0 {
        return LightReservoir(0u, 0u, 0u, 0u, 0.0, 1.0, 0.0);
    }
    let weight = min(total / (f32(count) * kept_weight) / kept.pmf, LIGHT_MAX_RESERVOIR_WEIGHT);
    let generation = light_generation(kept.instance, kept.light);
    return LightReservoir(kept.instance, kept.light, generation, kept_numbers, weight, 1.0, 0.0);
}

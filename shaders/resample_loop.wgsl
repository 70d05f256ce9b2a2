// Draws several candidates and keeps one in proportion to its weight. `u` in [0, 1) as for
// light_sample, which this equals for one candidate; `choice` in [0, 1) chooses among the
// candidates. `candidates` is clamped to 1 and LIGHT_MAX_CANDIDATES. Twin of
// `LightSampler::keep_one`; src/plan/text.rs replaces the placeholders.
fn LIGHT_RESAMPLE(LIGHT_PARAMETERS, u: vec4<f32>, choice: f32, candidates: u32) -> LightReservoir {
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
    // Its weight, and in the end W.
    var kept: LightReservoir;
    // #if SEGMENTS
    var along = 0.0;
    // #endif
    for (var i = 0u; i < count; i++) {
        let numbers = light_candidate_numbers(u, i, count);
        let pick = light_draw(&cut, directional_lux, shading_point, numbers.xy);
        let candidate = light_sample_drawn(shading_point, pick, numbers.zw);
        var weight = 0.0;
        if candidate.pmf > 0.0 {
            weight = LIGHT_WEIGHT(LIGHT_ARGUMENTS, candidate);
            // #if LEARNS
            weight *= light_place_share(learnt, shading_point, candidate);
            // #endif
        }
        if weight > 0.0 {
            total += weight;
            let share = weight / total;
            let is_kept = dice.u < share;
            dice = light_remap(dice, dice.u - select(share, 0.0, is_kept), select(1.0 - share, share, is_kept));
            if is_kept {
                kept = LightReservoir(candidate, weight);
                // #if SEGMENTS
                along = light_along;
                // #endif
            }
        }
    }
    // #if SEGMENTS
    light_along = along;
    // #endif
    if total > 0.0 {
        let density = max(kept.chosen.pmf * kept.chosen.pdf, LIGHT_MIN_PDF);
        kept.weight = min(total / (f32(count) * kept.weight) / density, LIGHT_MAX_RESERVOIR_WEIGHT);
    }
    return kept;
}

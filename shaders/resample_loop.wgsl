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
    var drawn: LightCandidates;
    var index = 0u;
    var candidate: LightSample;
    // All candidates in turn, then the one that is kept: computing its sample again takes less than
    // keeping the samples of all, and one place in the text computes both.
    loop {
        let numbers = light_candidate_numbers(u, index, count);
        if index == drawn.count {
            drawn.picks[index] = light_draw(&cut, directional_lux, shading_point, numbers.xy);
        }
        candidate = light_sample_drawn(shading_point, drawn.picks[index], numbers.zw);
        if drawn.count == count {
            break;
        }
        var weight = 0.0;
        if candidate.pmf > 0.0 {
            weight = LIGHT_WEIGHT(LIGHT_ARGUMENTS, candidate);
            // #if LEARNS
            weight *= light_place_share(learnt, shading_point, candidate);
            // #endif
        }
        light_add_weight(&drawn, weight);
        index = drawn.count;
        if index == count {
            index = light_kept_candidate(&drawn, choice);
            if index + 1u == count || drawn.total <= 0.0 {
                break;
            }
        }
    }
    return light_reservoir(&drawn, index, candidate);
}

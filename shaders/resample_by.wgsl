// Weighs candidates by a function of the engine, whose name src/plan/text.rs puts here. The names of
// locals cannot hide that function.

// The target of a candidate divided by its probability density; 0 if the candidate is not wanted.
// Twin of `target_weight`.
fn light_target_weight(
    light_shading_point: LightShadingPoint, light_argument: LIGHT_ARGUMENT, light_candidate: LightSample,
) -> f32 {
    let light_value = LIGHT_TARGET(light_shading_point, light_argument, light_candidate);
    let light_weight = light_clamp_weight(light_value / light_candidate.pdf / light_candidate.pmf);
    // GPUs may flush subnormal numbers to 0. The bits of NaN and of negative numbers are above those
    // of infinity.
    let light_bits = bitcast<u32>(light_value);
    return select(0.0, light_weight, light_bits >= LIGHT_TINY_BITS && light_bits <= LIGHT_INFINITY_BITS);
}

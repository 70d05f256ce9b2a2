
// One sample of all light that a surface reflects, kept among several candidates.
fn girandole_sample(surface: LightingInput, candidates: u32, seed: u32) -> vec3<f32> {
    let numbers = girandole_numbers(seed);
    let at = girandole_shading_point(surface);
    let kept = light_resample_by(at, surface, numbers.u, numbers.choice, candidates);
    if kept.weight <= 0.0 {
        return vec3(0.0);
    }
    let is_seen = girandole_is_seen(surface, kept.chosen);
    girandole_note(at, kept.chosen, is_seen, seed);
    if !is_seen {
        return vec3(0.0);
    }
    return girandole_reflected(surface, kept.chosen) * kept.weight;
}

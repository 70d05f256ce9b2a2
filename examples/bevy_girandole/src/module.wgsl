
// One sample of all light that a surface reflects, kept among several candidates. Without shadows:
// pass `light.direction` and `light.dist` to `girandole_sees` here.
fn girandole_sample(surface: LightingInput, candidates: u32, seed: u32) -> vec3<f32> {
    let numbers = girandole_numbers(seed);
    let at = girandole_shading_point(surface);
    let kept = light_resample(at, numbers.u, numbers.choice, candidates);
    let light = light_reservoir_sample(at, kept);
    if light.pmf <= 0.0 {
        return vec3(0.0);
    }
    return girandole_reflected(surface, light) / (light.pmf * light.pdf);
}

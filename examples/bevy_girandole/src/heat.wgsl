
// The colour of a pixel in a heat map, whatever the exposure.
fn girandole_estimate(surface: LightingInput, texel: vec2<i32>, seed: u32) -> vec3<f32> {
    let color = light_heat_map(girandole_shading_point(surface), girandole_view.heat_map, seed);
    return color / mesh_view_bindings::view.exposure;
}


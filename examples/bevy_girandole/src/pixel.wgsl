
// What a pixel of Bevy's deferred buffers shows.
struct GirandolePixel {
    // Whether it is a surface, and one that is lit.
    is_lit: bool,
    surface: LightingInput,
}

fn girandole_pixel(position: vec4<f32>) -> GirandolePixel {
    var pixel: GirandolePixel;
    let texel = vec2<i32>(position.xy);
    let packed = textureLoad(mesh_view_bindings::deferred_prepass_texture, texel, 0);
    let depth = textureLoad(mesh_view_bindings::depth_prepass_texture, texel, 0);
    if depth <= 0.0 || all(packed == vec4(0u)) {
        return pixel;
    }
    let pbr = pbr_input_from_deferred_gbuffer(vec4(position.xy, depth, 0.0), packed);
    pixel.is_lit = (pbr.material.flags & STANDARD_MATERIAL_FLAGS_UNLIT_BIT) == 0u;
    pixel.surface = girandole_surface(pbr);
    return pixel;
}

// What Bevy's lighting functions need to know of a surface: the first lines of `apply_pbr_lighting`.
fn girandole_surface(pbr: PbrInput) -> LightingInput {
    let color = pbr.material.base_color.rgb;
    let rough = pbr.material.perceptual_roughness;
    let n_dot_v = max(dot(pbr.N, pbr.V), 0.0001);
    var surface: LightingInput;
    surface.layers[lighting::LAYER_BASE].NdotV = n_dot_v;
    surface.layers[lighting::LAYER_BASE].N = pbr.N;
    surface.layers[lighting::LAYER_BASE].R = reflect(-pbr.V, pbr.N);
    surface.layers[lighting::LAYER_BASE].perceptual_roughness = rough;
    surface.layers[lighting::LAYER_BASE].roughness = lighting::perceptualRoughnessToRoughness(rough);
    let coat_rough = pbr.material.clearcoat_perceptual_roughness;
    surface.layers[lighting::LAYER_CLEARCOAT].NdotV = max(dot(pbr.clearcoat_N, pbr.V), 0.0001);
    surface.layers[lighting::LAYER_CLEARCOAT].N = pbr.clearcoat_N;
    surface.layers[lighting::LAYER_CLEARCOAT].R = reflect(-pbr.V, pbr.clearcoat_N);
    surface.layers[lighting::LAYER_CLEARCOAT].perceptual_roughness = coat_rough;
    surface.layers[lighting::LAYER_CLEARCOAT].roughness = lighting::perceptualRoughnessToRoughness(coat_rough);
    surface.clearcoat_strength = pbr.material.clearcoat;
    surface.P = pbr.world_position.xyz;
    surface.V = pbr.V;
    surface.diffuse_color = pbr_functions::calculate_diffuse_color(
        color, pbr.material.metallic, pbr.material.specular_transmission, pbr.material.diffuse_transmission);
    surface.metallic = pbr.material.metallic;
    surface.F0_dielectric = pbr_functions::calculate_F0_dielectric(pbr.material.reflectance);
    surface.F0_metallic = color;
    surface.F_ab = lighting::F_AB(rough, n_dot_v);
    return surface;
}

// The point for which Girandole chooses lights.
fn girandole_shading_point(surface: LightingInput) -> LightShadingPoint {
    let luminance = vec3(0.2126, 0.7152, 0.0722);
    let specular = dot(mix(surface.F0_dielectric, surface.F0_metallic, surface.metallic), luminance);
    let layer = surface.layers[lighting::LAYER_BASE];
    return light_glossy_point(
        surface.P, layer.N, surface.V, sqrt(layer.roughness), specular, dot(surface.diffuse_color, luminance));
}

// Whether the light of a sample arrives at a surface.
fn girandole_is_seen(surface: LightingInput, light: LightSample) -> bool {
    let camera_dist = distance(mesh_view_bindings::view.world_position, surface.P);
    let normal = surface.layers[lighting::LAYER_BASE].N;
    return girandole_sees(surface.P, normal, camera_dist, light.direction, light.dist);
}

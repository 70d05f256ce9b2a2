// Whether the light of a sample arrives at a surface.
fn girandole_is_seen(surface: LightingInput, light: LightSample) -> bool {
    let camera_dist = distance(mesh_view_bindings::view.world_position, surface.P);
    let normal = surface.layers[lighting::LAYER_BASE].N;
    return girandole_sees(surface.P, normal, camera_dist, light.direction, light.dist);
}

// Tells what a shadow ray has found to the table of learnt visibility. One of 16 samples teaches enough.
fn girandole_note(at: LightShadingPoint, light: LightSample, is_seen: bool, seed: u32) {
    if (light_hash(seed) & 15u) == 0u {
        light_record_visibility(at, light, is_seen);
    }
}

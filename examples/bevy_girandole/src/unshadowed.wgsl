// Whether the light of a sample arrives at a surface: nothing casts shadows.
fn girandole_is_seen(surface: LightingInput, light: LightSample) -> bool {
    return true;
}

fn girandole_note(at: LightShadingPoint, light: LightSample, is_seen: bool, seed: u32) {}

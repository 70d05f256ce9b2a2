// There is no table of learnt visibility.
fn girandole_note(at: LightShadingPoint, light: LightSample, is_seen: bool, seed: u32) {}

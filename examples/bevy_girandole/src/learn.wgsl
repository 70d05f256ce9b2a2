// Tells what a shadow ray has found to the table of learnt visibility. One of 16 samples teaches enough.
fn girandole_note(at: LightShadingPoint, light: LightSample, is_seen: bool, seed: u32) {
    if (light_hash(seed) & 15u) == 0u {
        light_record_visibility(at, light, is_seen);
    }
}

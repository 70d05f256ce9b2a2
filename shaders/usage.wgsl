// Counts how often lights of each instance are chosen. src/gpu/picks/mod.rs brings the counts back. The binding stands
// beside those of sample.wgsl, in layouts that count.

// By slot of the instance; the first, which is no instance's, holds the largest hash that is counted, or 0 for none.
@group(LIGHT_GROUP) @binding(5) var<storage, read_write> light_pick_counts: array<atomic<u32>>;

// Counts a light of this instance as chosen. Of all calls a share is counted, by a hash of `u`: give it the numbers that
// chose the light. Directional lights and "no light" may be given, and count for nobody.
fn light_record_usage(instance: u32, u: vec4<f32>) {
    // 0xffffffff, for directional lights, is past the end.
    if instance == 0u || instance >= arrayLength(&light_pick_counts) {
        return;
    }
    let bits = bitcast<vec4<u32>>(u);
    let hash = light_hash(bits.x ^ light_hash(bits.y ^ light_hash(bits.z ^ light_hash(bits.w))));
    let most = atomicLoad(&light_pick_counts[0]);
    if most > 0u && hash <= most {
        atomicAdd(&light_pick_counts[instance], 1u);
    }
}

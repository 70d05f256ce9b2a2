// Counts how often the lights of each instance are chosen. src/gpu/usage brings the counts back.
// The binding joins those of sample.wgsl, in the layout that counts usage.

// A word for each instance slot. No instance has slot 0: its word holds the largest hash that is
// counted, or 0 to count nothing.
@group(LIGHT_GROUP) @binding(5) var<storage, read_write> light_usage_counts: array<atomic<u32>>;

// Records that a light of this instance was chosen. `u` holds the numbers that chose the light:
// their hash decides whether the call is counted. Directional lights and "no light" are never
// counted.
fn light_record_usage(instance: u32, u: vec4<f32>) {
    // A directional light has slot 0xffffffff, which is past the end.
    if instance == 0u || instance >= arrayLength(&light_usage_counts) {
        return;
    }
    let bits = bitcast<vec4<u32>>(u);
    let hash = light_hash(bits.x ^ light_hash(bits.y ^ light_hash(bits.z ^ light_hash(bits.w))));
    let max_hash = atomicLoad(&light_usage_counts[0]);
    if max_hash > 0u && hash <= max_hash {
        atomicAdd(&light_usage_counts[instance], 1u);
    }
}

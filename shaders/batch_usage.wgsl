// Records the usage of the lights that one of our kernels has chosen for a buffer of shading
// points. src/gpu/usage/kernel.rs records it, and says where in the records the words lie.

@group(1) @binding(0) var<storage, read> requests: array<u32>;
@group(1) @binding(1) var<storage, read> samples: array<u32>;

@compute @workgroup_size(64)
fn batch_usage(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.x + id.y * groups.x * 64u;
    if i >= arrayLength(&samples) / SAMPLE_WORDS {
        return;
    }
    let chosen = i * SAMPLE_WORDS;
    if bitcast<f32>(samples[chosen + PMF_WORD]) > 0.0 {
        let u = i * REQUEST_WORDS + U_WORD;
        let bits = vec4(requests[u], requests[u + 1u], requests[u + 2u], requests[u + 3u]);
        light_record_usage(samples[chosen + INSTANCE_WORD], bitcast<vec4<f32>>(bits));
    }
}

// Keeps one of several candidates for each shading point of a buffer. `Kernel` in src/gpu/kernel.rs
// records it, behind request.wgsl.

@group(1) @binding(0) var<storage, read> requests: array<Request>;
@group(1) @binding(1) var<storage, read_write> samples: array<LightSample>;
// The number of candidates in x.
@group(1) @binding(2) var<uniform> candidates: vec4<u32>;

@compute @workgroup_size(64)
fn batch_resample(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.x + id.y * groups.x * 64u;
    if i >= arrayLength(&requests) {
        return;
    }
    let shading_point = light_surface_point(requests[i].position, requests[i].normal);
    light_mark(shading_point);
    let kept = light_resample(shading_point, requests[i].u, requests[i].choice, candidates.x);
    samples[i] = light_reservoir_sample(shading_point, kept);
}

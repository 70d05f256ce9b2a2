// Keeps one of several candidates for each shading point of a buffer. src/gpu/resampling.rs records it.

// Twin of `SampleRequest`.
struct Request {
    position: vec3<f32>,
    padding_a: u32,
    normal: vec3<f32>,
    padding_b: u32,
    u: vec4<f32>,
}

@group(1) @binding(0) var<storage, read> requests: array<Request>;
@group(1) @binding(1) var<storage, read_write> samples: array<LightReservoir>;
@group(1) @binding(2) var<uniform> candidates: vec4<u32>;

@compute @workgroup_size(64)
fn batch_resample(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.x + id.y * groups.x * 64u;
    if i >= arrayLength(&requests) {
        return;
    }
    let shading_point = light_surface_point(requests[i].position, requests[i].normal);
    samples[i] = light_resample(shading_point, requests[i].u, candidates.x);
}

// Samples one light for each shading point of a buffer. Behind request.wgsl.

@group(1) @binding(0) var<storage, read> requests: array<Request>;
@group(1) @binding(1) var<storage, read_write> samples: array<LightSample>;

@compute @workgroup_size(64)
fn batch(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.x + id.y * groups.x * 64u;
    if i >= arrayLength(&requests) {
        return;
    }
    let shading_point = light_surface_point(requests[i].position, requests[i].normal);
    light_mark(shading_point);
    samples[i] = light_sample(shading_point, requests[i].u);
}

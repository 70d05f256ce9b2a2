// One light sample per pixel, as in an engine but without shadow rays and materials. The host puts
// the constant CANDIDATES and request.wgsl of the testbed before this text.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read_write> pixels: array<vec4<f32>>;

@compute @workgroup_size(64)
fn sample(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    if i >= arrayLength(&requests) {
        return;
    }
    let shading_point = light_surface_point(requests[i].position, requests[i].normal);
    var chosen: LightSample;
    if CANDIDATES == 1u {
        chosen = light_sample(shading_point, requests[i].u);
    } else {
        let kept = light_resample(shading_point, requests[i].u, requests[i].u.w, CANDIDATES);
        chosen = light_reservoir_sample(shading_point, kept);
    }
    let weight = 1.0 / (chosen.pmf * chosen.pdf);
    let cosine = max(dot(shading_point.normal, chosen.direction), 0.0);
    pixels[i] = vec4(select(vec3(0.0), chosen.radiance * cosine * weight, chosen.pmf > 0.0), chosen.dist);
}

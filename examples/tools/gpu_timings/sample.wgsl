// What an engine does with a light at each pixel, but for shadow rays and materials. CANDIDATES
// and shaders/request.wgsl come before this text.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read_write> pixels: array<vec4<f32>>;

@compute @workgroup_size(64)
fn sample(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    if i >= arrayLength(&requests) {
        return;
    }
    let shading_point = light_surface_point(requests[i].position, requests[i].normal);
    var drawn: LightSample;
    var weight = 0.0;
    if CANDIDATES == 1u {
        drawn = light_sample(shading_point, requests[i].u);
        weight = 1.0 / (drawn.pmf * drawn.pdf);
    } else {
        let kept = light_resample(shading_point, requests[i].u, CANDIDATES);
        drawn = kept.chosen;
        weight = kept.weight;
    }
    let cosine = max(dot(shading_point.normal, drawn.direction), 0.0);
    pixels[i] = vec4(select(vec3(0.0), drawn.radiance * cosine * weight, drawn.pmf > 0.0), drawn.dist);
}

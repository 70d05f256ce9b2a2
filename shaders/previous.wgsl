// The lights of the last frame. Joined behind a copy of `light_reservoir_sample` that reads these in place of the
// present buffers: see `functions` in src/plan/text.rs. src/plan/previous.rs owns the buffer.

// Three quads with the parameters of that frame, one whose first word is where the lights begin, the instances, and the
// lights.
@group(LIGHT_GROUP) @binding(7) var<storage, read> light_previous: array<vec4<u32>>;
var<private> light_params_then: LightParams;

fn light_instance_quad_then(at: u32) -> vec4<u32> {
    return light_previous[LIGHT_PREVIOUS_HEAD + at];
}

fn light_record_quad_then(at: u32) -> vec4<u32> {
    return light_previous[light_previous[LIGHT_PREVIOUS_HEAD - 1u].x + at];
}

fn light_record_quads_then() -> u32 {
    return arrayLength(&light_previous) - light_previous[LIGHT_PREVIOUS_HEAD - 1u].x;
}

// Returns the light of a reservoir at any shading point, as it was in the last frame. The pmf is 0 if it did not exist.
fn light_reservoir_sample_previous(shading_point: LightShadingPoint, reservoir: LightReservoir) -> LightSample {
    let first = light_previous[0];
    let places = light_previous[1];
    let last = light_previous[2];
    light_params_then = LightParams(
        first.x, first.y, first.z, first.w, places.x, places.y, places.z, places.w, bitcast<vec3<i32>>(last.xyz),
    );
    let chosen = light_reservoir_sample_then(shading_point, reservoir);
    // #if SEGMENTS
    light_along = light_along_then;
    // #endif
    return chosen;
}

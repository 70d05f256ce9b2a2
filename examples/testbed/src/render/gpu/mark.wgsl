// Each invocation marks the cell of the surface that a pixel shows: of its first sample.

@compute @workgroup_size(8, 8)
fn mark(@builtin(global_invocation_id) id: vec3<u32>) {
    let row = frame.row_begin + id.y;
    if id.x >= frame.width || row >= frame.row_end {
        return;
    }
    let sequence = pixel_sequence(vec2<u32>(id.x, row), frame.block_bits, frame.tile_bits);
    let jitter = sample_numbers(sequence, 0u).pixel.xy;
    let direction = camera_direction(vec2<f32>(f32(id.x), f32(row)), jitter);
    let hit = trace(frame.eye, direction, FAR, false, opacity_seed(row * frame.width + id.x, 0u));
    if hit.object == NOTHING {
        return;
    }
    let at = met_surface(direction, hit);
    if !at.is_unlit {
        light_mark(shading_point(at));
    }
}

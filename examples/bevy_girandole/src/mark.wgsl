
// The pass that marks the cells of pixels, ahead of the pass that lights these.
@fragment
fn girandole_fragment(@builtin(position) position: vec4<f32>) {
    let pixel = girandole_pixel(position);
    if pixel.is_lit {
        light_mark(girandole_shading_point(pixel.surface));
    }
}

// Reads the packed fields of a node. Twin of src/tree/node.rs. Binds nothing.

fn light_unpack_direction(bits: u32) -> vec3<f32> {
    let oct = unpack2x16snorm(bits);
    let z = 1.0 - abs(oct.x) - abs(oct.y);
    let fold = max(-z, 0.0);
    let sign = select(vec2(-1.0), vec2(1.0), oct >= vec2(0.0));
    return normalize(vec3(oct - fold * sign, z));
}

// Cosine of the half-angle of the cone of emission; -1 proves nothing.
fn light_cos_half_angle(child: LightChild) -> f32 {
    return unpack2x16snorm(child.angles).y;
}

// Length of the mean direction, in [0, 1].
fn light_lobe_length(child: LightChild) -> f32 {
    return unpack2x16unorm(child.angles).x;
}

// A shading point and its random numbers. Twin of `SampleRequest` in batch.rs. Joined before the
// stages that read it.
struct Request {
    // Metres, relative to the world's origin.
    position: vec3<f32>,
    padding: u32,
    // Unit normal, or zero for a point in a volume.
    normal: vec3<f32>,
    padding_after_normal: u32,
    // In [0, 1).
    u: vec4<f32>,
}


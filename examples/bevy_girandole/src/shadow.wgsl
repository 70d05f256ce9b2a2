// Whether anything stands between a surface and a light. `girandole_is_free` is in shadow_walk.wgsl or in
// shadow_query.wgsl, whichever the device calls for.

// The share of the way to a light that is looked at. The light itself casts no shadow on what it lights.
const GIRANDOLE_WAY: f32 = 0.999;
// How far above a surface a ray begins: metres, and by how much more for each metre from the origin or the camera.
const GIRANDOLE_LIFT: f32 = 0.001;
const GIRANDOLE_LIFT_SHARE: f32 = 1.0e-5;

// Whether a surface sees a light in a direction of length 1, at a distance. The normal has length 1 and the
// camera is at a distance.
fn girandole_sees(
    position: vec3<f32>, normal: vec3<f32>, camera_dist: f32, direction: vec3<f32>, dist: f32,
) -> bool {
    let size = max(max(abs(position.x), abs(position.y)), max(abs(position.z), camera_dist));
    let origin = position + normal * (GIRANDOLE_LIFT + GIRANDOLE_LIFT_SHARE * size);
    return girandole_is_free(origin, direction, GIRANDOLE_WAY * dist);
}

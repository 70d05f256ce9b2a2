// What an instance does to places and normals, from what is stored of it. Twin of `Frame` in src/emit.rs and of
// `InstanceRecord::of`. Binds nothing.

fn light_linear(rows: array<vec4<f32>, 3>, v: vec3<f32>) -> vec3<f32> {
    return vec3(dot(rows[0].xyz, v), dot(rows[1].xyz, v), dot(rows[2].xyz, v));
}

fn light_transposed(rows: array<vec4<f32>, 3>, v: vec3<f32>) -> vec3<f32> {
    return rows[0].xyz * v.x + rows[1].xyz * v.y + rows[2].xyz * v.z;
}

fn light_translation(rows: array<vec4<f32>, 3>) -> vec3<f32> {
    return vec3(rows[0].w, rows[1].w, rows[2].w);
}

fn light_rows(x: vec4<u32>, y: vec4<u32>, z: vec4<u32>) -> array<vec4<f32>, 3> {
    return array(bitcast<vec4<f32>>(x), bitcast<vec4<f32>>(y), bitcast<vec4<f32>>(z));
}

// #if NON_RIGID
// What the way back is where nothing is stored of it: the transpose, and no scale.
fn light_rigid_to_local(to_world: array<vec4<f32>, 3>) -> array<vec4<f32>, 3> {
    return array(
        vec4(to_world[0].x, to_world[1].x, to_world[2].x, 1.0),
        vec4(to_world[0].y, to_world[1].y, to_world[2].y, 1.0),
        vec4(to_world[0].z, to_world[1].z, to_world[2].z, 1.0),
    );
}
// #endif

// A vector of the world in the tree's space.
fn light_into_tree(instance: LightInstance, v: vec3<f32>) -> vec3<f32> {
    var inside = light_transposed(instance.to_world, v);
    // #if NON_RIGID
    inside = light_linear(instance.to_local, v);
    // #endif
    return inside;
}

// #if AREAS
// Volume in the world of one cubic metre of the tree's space.
fn light_volume(instance: LightInstance) -> f32 {
    var volume = 1.0;
    // #if NON_RIGID
    volume = abs(instance.to_local[0].w);
    // #endif
    return volume;
}

// A normal times an area, carried along by the cofactors.
fn light_normal_area(normal_area: vec3<f32>, instance: LightInstance) -> vec3<f32> {
    var moved = light_linear(instance.to_world, normal_area);
    // #if NON_RIGID
    moved = light_transposed(instance.to_local, normal_area) * abs(instance.to_local[0].w);
    // #endif
    return moved;
}
// #endif

// A suit of lamps: each invocation takes one lamp to where its bone is, and writes it as a light.
//
// `sparks.wgsl` precedes this file.

struct Lamp {
    a: vec3<f32>,
    bone: u32,
    b: vec3<f32>,
    c: vec3<f32>,
    radiance: vec3<f32>,
}

// Rows of the transform from the space of a bone, and the factor on its radiance.
struct Bone {
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
    glow: f32,
}

@group(0) @binding(2) var<storage, read> lamps: array<Lamp>;
@group(0) @binding(3) var<storage, read> bones: array<Bone>;

fn placed(bone: Bone, point: vec3<f32>) -> vec3<f32> {
    let p = vec4<f32>(point, 1.0);
    return vec3<f32>(dot(bone.x, p), dot(bone.y, p), dot(bone.z, p));
}

@compute @workgroup_size(64)
fn move_lamps(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&lamps) {
        return;
    }
    let lamp = lamps[id.x];
    let bone = bones[lamp.bone];
    light_put_triangle(
        step_now.suit, id.x, placed(bone, lamp.a), placed(bone, lamp.b), placed(bone, lamp.c),
        lamp.radiance * bone.glow,
    );
}

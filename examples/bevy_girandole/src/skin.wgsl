// Poses the triangles of skinned emissive meshes, and writes them as lights. The text of
// `girandole::plan::wgsl_of_sources` goes before this one.

// Twin of `Corner` in skins.rs.
struct GirandoleCorner {
    place: vec3<f32>,
    emission: f32,
    weights: vec4<f32>,
    joints: vec2<u32>,
    padding: vec2<u32>,
}

// One entity with the mesh.
struct GirandoleSkin {
    source: u32,
    first_joint: u32,
    joint_count: u32,
    padding: u32,
}

@group(0) @binding(0) var<storage, read> girandole_corners: array<GirandoleCorner>;
@group(0) @binding(1) var<storage, read> girandole_skins: array<GirandoleSkin>;
// From the space of the mesh to the world.
@group(0) @binding(2) var<storage, read> girandole_joints: array<mat4x4<f32>>;

fn girandole_posed(skin: GirandoleSkin, corner: u32) -> vec3<f32> {
    let at = vec4(girandole_corners[corner].place, 1.0);
    var place = vec3(0.0);
    for (var k = 0u; k < 4u; k++) {
        let weight = girandole_corners[corner].weights[k];
        let joint = (girandole_corners[corner].joints[k / 2u] >> (16u * (k % 2u))) & 0xffffu;
        if joint < skin.joint_count {
            place += weight * (girandole_joints[skin.first_joint + joint] * at).xyz;
        }
    }
    return place;
}

// One invocation for each triangle of each entity.
@compute @workgroup_size(64)
fn girandole_skin(@builtin(global_invocation_id) id: vec3<u32>) {
    let first = 3u * id.x;
    if first >= arrayLength(&girandole_corners) {
        return;
    }
    let skin = girandole_skins[id.y];
    let emission = vec3(
        girandole_corners[first].emission,
        girandole_corners[first + 1u].emission,
        girandole_corners[first + 2u].emission,
    );
    light_put_triangle(
        skin.source,
        id.x,
        girandole_posed(skin, first),
        girandole_posed(skin, first + 1u),
        girandole_posed(skin, first + 2u),
        emission,
    );
}

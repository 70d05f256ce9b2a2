// Poses the triangles of emissive meshes by morph targets and joints, as Bevy's vertex shader does, and writes them as
// lights. The text of `girandole::plan::wgsl_of_sources` goes before this one.

// Twin of `Corner` in rigs.rs.
struct GirandoleCorner {
    place: vec3<f32>,
    emission: f32,
    weights: vec4<f32>,
    joints: vec2<u32>,
    padding: vec2<u32>,
}

// One entity with the mesh.
struct GirandolePose {
    source: u32,
    first_joint: u32,
    joint_count: u32,
    first_weight: u32,
}

@group(0) @binding(0) var<storage, read> girandole_corners: array<GirandoleCorner>;
@group(0) @binding(1) var<storage, read> girandole_poses: array<GirandolePose>;
// From the space of the mesh to the world.
@group(0) @binding(2) var<storage, read> girandole_joints: array<mat4x4<f32>>;
// How far each morph target moves each corner, in three floats: all corners by the first target, then by the second.
@group(0) @binding(3) var<storage, read> girandole_offsets: array<f32>;
@group(0) @binding(4) var<storage, read> girandole_weights: array<f32>;

// Where morph targets move a corner to, in the space of the mesh.
fn girandole_morphed(pose: GirandolePose, corner: u32) -> vec3<f32> {
    let floats = 3u * arrayLength(&girandole_corners);
    let targets = arrayLength(&girandole_offsets) / floats;
    var place = girandole_corners[corner].place;
    for (var k = 0u; k < targets; k++) {
        let weight = girandole_weights[pose.first_weight + k];
        if weight != 0.0 {
            let at = k * floats + 3u * corner;
            place += weight * vec3(girandole_offsets[at], girandole_offsets[at + 1u], girandole_offsets[at + 2u]);
        }
    }
    return place;
}

// Twin of `PosedMesh::posed` in rigs.rs.
fn girandole_posed(pose: GirandolePose, corner: u32) -> vec3<f32> {
    let at = vec4(girandole_morphed(pose, corner), 1.0);
    var place = vec3(0.0);
    for (var k = 0u; k < 4u; k++) {
        let weight = girandole_corners[corner].weights[k];
        let joint = (girandole_corners[corner].joints[k / 2u] >> (16u * (k % 2u))) & 0xffffu;
        if joint < pose.joint_count {
            place += weight * (girandole_joints[pose.first_joint + joint] * at).xyz;
        }
    }
    return place;
}

// One invocation for each triangle of each entity.
@compute @workgroup_size(64)
fn girandole_pose(@builtin(global_invocation_id) id: vec3<u32>) {
    let first = 3u * id.x;
    if first >= arrayLength(&girandole_corners) {
        return;
    }
    let pose = girandole_poses[id.y];
    let emission = vec3(
        girandole_corners[first].emission,
        girandole_corners[first + 1u].emission,
        girandole_corners[first + 2u].emission,
    );
    light_put_triangle(
        pose.source,
        id.x,
        girandole_posed(pose, first),
        girandole_posed(pose, first + 1u),
        girandole_posed(pose, first + 2u),
        emission,
    );
}

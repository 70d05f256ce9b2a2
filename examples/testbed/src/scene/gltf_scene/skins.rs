//! Meshes of nodes with skins, posed by their joints at rest.

use girandole::glam::{DMat4, Mat4, Vec3};
use girandole_assets::AssetError;
use girandole_assets::gltf::gltf::{Node, Semantic};
use girandole_assets::gltf::{GltfFile, SceneNode, accessor_values, primitive_attribute};

use super::Mesh;

/// A copy of a node's mesh in world space, posed by the node's skin. As glTF states, the transform of the
/// node has no effect. `placed` are the nodes of the scene, by index. `None` if a joint is not part of the scene, or
/// if a vertex has no joint.
pub fn posed(
    node: &Node<'_>,
    mesh: &Mesh,
    file: &GltfFile,
    placed: &[Option<SceneNode>],
) -> Result<Option<Mesh>, AssetError> {
    let (Some(skin), Some(source)) = (node.skin(), node.mesh()) else { return Ok(None) };
    let binds = skin.inverse_bind_matrices().map(|accessor| accessor_values::<16>(&accessor, &file.buffers));
    let binds = binds.transpose()?;
    let joint = |(place, joint): (usize, Node<'_>)| {
        let bind = binds.as_ref().map_or(Some(Mat4::IDENTITY), |all| all.get(place).map(Mat4::from_cols_array))?;
        Some(DMat4::from(placed[joint.index()]?.transform).as_mat4() * bind)
    };
    let Some(joints) = skin.joints().enumerate().map(joint).collect::<Option<Vec<Mat4>>>() else { return Ok(None) };
    let mut posed = mesh.clone();
    let mut first = 0;
    for primitive in source.primitives() {
        let positions = primitive_attribute::<3>(source.index(), &primitive, &Semantic::Positions, &file.buffers)?;
        let count = positions.map_or(0, |triangles| triangles.len());
        if count == 0 {
            continue;
        }
        let read = |semantic| primitive_attribute::<4>(source.index(), &primitive, &semantic, &file.buffers);
        let (indices, weights) = (read(Semantic::Joints(0))?, read(Semantic::Weights(0))?);
        let (Some(indices), Some(weights)) = (indices, weights) else { return Ok(None) };
        for (index, (indices, weights)) in indices.into_iter().zip(weights).enumerate() {
            for corner in 0..3 {
                let joint = |k: usize| Some(*joints.get(indices[corner][k] as usize)? * weights[corner][k]);
                let Some(pose) = (0..4).map(joint).sum::<Option<Mat4>>() else { return Ok(None) };
                let vertex = &mut posed.triangles[first + index].vertices[corner];
                let moved = pose * vertex.extend(1.0);
                // The sum of the weights, by which the mean of the joints is divided.
                *vertex = moved.truncate() / moved.w;
                if !vertex.is_finite() {
                    return Ok(None);
                }
                if let Some(normals) = posed.normals.get_mut(first + index) {
                    let [x, y, z] = [pose.x_axis, pose.y_axis, pose.z_axis].map(|axis| axis.truncate());
                    let Vec3 { x: a, y: b, z: c } = normals[corner].truncate();
                    // By the cofactors, which are the transpose of the inverse but for a factor.
                    let normal = y.cross(z) * a + z.cross(x) * b + x.cross(y) * c;
                    normals[corner] = normal.normalize_or_zero().extend(0.0);
                }
            }
        }
        first += count;
    }
    Ok(Some(posed))
}

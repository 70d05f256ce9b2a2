//! Transforms of nodes, multiplied down the hierarchy in f64.

use ::gltf::scene::Transform;
use ::gltf::{Document, Node};
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Mat3, Quat, Vec3};

use super::error::GltfError;
use crate::placement::Placement;

/// A rotation whose squared length is below this has no direction.
const MIN_ROTATION_LENGTH_SQ: f64 = 1e-12;

/// A node's transform to the space of its parent.
///
/// # Errors
/// [`GltfError::Transform`] if the transform is not finite or its rotation has no length.
pub fn local_transform(node: &Node<'_>) -> Result<DAffine3, GltfError> {
    let invalid = GltfError::Transform { node: node.index() };
    let local = match node.transform() {
        Transform::Matrix { matrix } => {
            let columns = matrix.map(|column| column.map(f64::from));
            DAffine3::from_mat4(DMat4::from_cols_array_2d(&columns))
        }
        Transform::Decomposed { translation, rotation, scale } => {
            let [translation, scale] = [translation, scale].map(|v| DVec3::from(v.map(f64::from)));
            let rotation = DQuat::from_array(rotation.map(f64::from));
            if !rotation.is_finite() || rotation.length_squared() < MIN_ROTATION_LENGTH_SQ {
                return Err(invalid);
            }
            DAffine3::from_scale_rotation_translation(scale, rotation.normalize(), translation)
        }
    };
    if local.is_finite() { Ok(local) } else { Err(invalid) }
}

/// The nodes of the document's scene with their parents, in depth-first order, parents before
/// children.
///
/// The scene is the default scene, else the first scene. A document without scenes counts as one
/// scene of all nodes.
///
/// # Errors
/// [`GltfError::NotATree`] if a node has two parents or is its own ancestor.
pub fn scene_nodes(document: &Document) -> Result<Vec<(usize, Option<usize>)>, GltfError> {
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let mut stack: Vec<(usize, Option<usize>)> = match &scene {
        Some(scene) => scene.nodes().map(|node| (node.index(), None)).collect(),
        None => {
            let mut is_child = vec![false; document.nodes().len()];
            document.nodes().flat_map(|node| node.children()).for_each(|child| is_child[child.index()] = true);
            (0..is_child.len()).filter(|&node| !is_child[node]).map(|node| (node, None)).collect()
        }
    };
    let nodes: Vec<Node<'_>> = document.nodes().collect();
    let mut visited = vec![false; nodes.len()];
    let mut order = Vec::with_capacity(nodes.len());
    stack.reverse();
    while let Some((node, parent)) = stack.pop() {
        if std::mem::replace(&mut visited[node], true) {
            return Err(GltfError::NotATree { node });
        }
        order.push((node, parent));
        let first = stack.len();
        stack.extend(nodes[node].children().map(|child| (child.index(), Some(node))));
        stack[first..].reverse();
    }
    // Without scenes every node hangs from a node without a parent, unless it is part of a cycle.
    match visited.iter().position(|visited| !visited) {
        Some(node) if scene.is_none() => Err(GltfError::NotATree { node }),
        _ => Ok(order),
    }
}

/// Each node's transform to the world, by node index; `None` for nodes that are not part of the
/// scene.
///
/// # Errors
/// [`GltfError::Transform`] and [`GltfError::NotATree`], as for [`local_transform`] and
/// [`scene_nodes`].
pub fn world_transforms(document: &Document) -> Result<Vec<Option<DAffine3>>, GltfError> {
    let nodes: Vec<Node<'_>> = document.nodes().collect();
    let mut world: Vec<Option<DAffine3>> = vec![None; nodes.len()];
    for (node, parent) in scene_nodes(document)? {
        let local = local_transform(&nodes[node])?;
        let transform = match parent.and_then(|parent| world[parent]) {
            Some(parent) => parent * local,
            None => local,
        };
        if !transform.is_finite() {
            return Err(GltfError::Transform { node });
        }
        world[node] = Some(transform);
    }
    Ok(world)
}

/// The placement of a node's point or spot light. glTF ignores scale for lights, except for the
/// direction of -Z.
///
/// A transform whose linear part is all zero hides its node: the placement then has a linear part
/// of zero too. Returns `None` if the transform is not finite, or flattens -Z but not all of space.
pub fn punctual_placement(transform: &DAffine3) -> Option<Placement> {
    if !transform.translation.is_finite() {
        return None;
    }
    if is_hidden(transform) {
        return Some((*transform).into());
    }
    let forward = (transform.matrix3 * DVec3::NEG_Z).try_normalize()?.as_vec3();
    let rotation = Quat::from_rotation_arc(Vec3::NEG_Z, forward.normalize());
    let linear = DMat3::from_quat(rotation.as_dquat());
    Some(DAffine3::from_mat3_translation(linear, transform.translation).into())
}

/// Whether a node's scale, or that of an ancestor, is zero along all axes, in the precision of a
/// [`Placement`].
pub(super) fn is_hidden(transform: &DAffine3) -> bool {
    transform.matrix3.as_mat3() == Mat3::ZERO
}

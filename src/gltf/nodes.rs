//! Transforms of nodes, multiplied down the hierarchy in f64.

use ::gltf::scene::Transform;
use ::gltf::{Document, Node};
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Mat3, Quat, Vec3};

use super::check::NODE_VISIBILITY;
use super::error::{GltfError, document_error};
use crate::instance::placement::Placement;

/// A rotation whose squared length is below this has no direction.
pub(super) const MIN_ROTATION_LENGTH_SQ: f64 = 1e-12;
/// A determinant below this share of the product of the columns' lengths is zero but for rounding,
/// which is 2^-53 for each of some ten products.
const MAX_FLAT_DETERMINANT: f64 = 1e-12;

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

/// Whether each node is shown, by node index: KHR_node_visibility hides nodes with all below them.
///
/// # Errors
/// [`GltfError::Document`] if a node's extension is not valid, and those of [`scene_nodes`].
pub fn node_visibility(document: &Document) -> Result<Vec<bool>, GltfError> {
    let mut visible = Vec::with_capacity(document.nodes().len());
    for node in document.nodes() {
        let value = node.extension_value(NODE_VISIBILITY).and_then(|extension| extension.get("visible"));
        let invalid = || document_error(&format!("node {}: {NODE_VISIBILITY} is neither true nor false", node.index()));
        visible.push(value.map_or(Some(true), |value| value.as_bool()).ok_or_else(invalid)?);
    }
    for (node, parent) in scene_nodes(document)? {
        visible[node] &= parent.is_none_or(|parent| visible[parent]);
    }
    Ok(visible)
}

/// The placement of a node's emissive surfaces: its transform, in the precision of a [`Placement`].
///
/// A transform that [`is_hidden`] gives a linear part of zero, so that the instance contributes
/// nothing until it is moved.
pub fn surface_placement(transform: &DAffine3) -> Placement {
    let linear = if is_hidden(transform) { Mat3::ZERO } else { transform.matrix3.as_mat3() };
    Placement { linear, translation: transform.translation }
}

/// The placement of a node's point or spot light. glTF ignores scale for lights, except for the
/// direction of -Z.
///
/// A transform that [`is_hidden`] gives a linear part of zero, so that the instance contributes
/// nothing until it is moved. Returns `None` if the transform is not finite.
pub fn punctual_placement(transform: &DAffine3) -> Option<Placement> {
    if !transform.is_finite() {
        return None;
    }
    if is_hidden(transform) {
        return Some(surface_placement(transform));
    }
    let forward = (transform.matrix3 * DVec3::NEG_Z).try_normalize()?.as_vec3();
    let rotation = Quat::from_rotation_arc(Vec3::NEG_Z, forward.normalize());
    let linear = DMat3::from_quat(rotation.as_dquat());
    Some(DAffine3::from_mat3_translation(linear, transform.translation).into())
}

/// Whether the scale of a node or of an ancestor is zero along one or more axes, or too small for
/// f32. Files hide nodes by a scale of zero.
///
/// The product of scales and rotations is rounded, so a transform counts as flat if its determinant
/// is below 1e-12 of the product of its columns' lengths.
pub fn is_hidden(transform: &DAffine3) -> bool {
    let matrix = &transform.matrix3;
    let lengths = matrix.x_axis.length() * matrix.y_axis.length() * matrix.z_axis.length();
    matrix.as_mat3() == Mat3::ZERO || matrix.determinant().abs() <= MAX_FLAT_DETERMINANT * lengths
}

//! Where nodes stand: their transforms down the hierarchy, in f64.

use ::gltf::scene::Transform;
use ::gltf::{Document, Node};
use glam::{DAffine3, DMat4, DQuat, DVec3};

use super::GltfError;

/// A node's own transform, to its parent's space.
///
/// # Errors
/// [`GltfError::Transform`].
pub fn local_transform(node: &Node<'_>) -> Result<DAffine3, GltfError> {
    let broken = GltfError::Transform { node: node.index() };
    let local = match node.transform() {
        Transform::Matrix { matrix } => {
            let columns = matrix.map(|column| column.map(f64::from));
            DAffine3::from_mat4(DMat4::from_cols_array_2d(&columns))
        }
        Transform::Decomposed { translation, rotation, scale } => {
            let [translation, scale] = [translation, scale].map(|v| DVec3::from(v.map(f64::from)));
            let rotation = DQuat::from_array(rotation.map(f64::from));
            if !rotation.is_finite() || rotation.length_squared() < 1e-12 {
                return Err(broken);
            }
            DAffine3::from_scale_rotation_translation(scale, rotation.normalize(), translation)
        }
    };
    if local.is_finite() { Ok(local) } else { Err(broken) }
}

/// The nodes of the document's scene, parents before children, each with its parent: the default scene, else the first,
/// else everything that has no parent.
///
/// # Errors
/// [`GltfError::NotATree`].
pub fn scene_nodes(document: &Document) -> Result<Vec<(usize, Option<usize>)>, GltfError> {
    let mut open: Vec<(usize, Option<usize>)> = match document.default_scene().or_else(|| document.scenes().next()) {
        Some(scene) => scene.nodes().map(|node| (node.index(), None)).collect(),
        None => {
            let mut is_child = vec![false; document.nodes().len()];
            document.nodes().flat_map(|node| node.children()).for_each(|child| is_child[child.index()] = true);
            (0..is_child.len()).filter(|&node| !is_child[node]).map(|node| (node, None)).collect()
        }
    };
    let nodes: Vec<Node<'_>> = document.nodes().collect();
    let mut seen = vec![false; nodes.len()];
    let mut order = Vec::with_capacity(nodes.len());
    open.reverse();
    while let Some((node, parent)) = open.pop() {
        if std::mem::replace(&mut seen[node], true) {
            return Err(GltfError::NotATree { node });
        }
        order.push((node, parent));
        let first = open.len();
        open.extend(nodes[node].children().map(|child| (child.index(), Some(node))));
        open[first..].reverse();
    }
    Ok(order)
}

/// Each node's transform to the world, `None` for nodes that the scene leaves out.
///
/// # Errors
/// [`GltfError::Transform`], [`GltfError::NotATree`].
pub fn world_transforms(document: &Document) -> Result<Vec<Option<DAffine3>>, GltfError> {
    let locals: Vec<Node<'_>> = document.nodes().collect();
    let mut world: Vec<Option<DAffine3>> = vec![None; locals.len()];
    for (node, parent) in scene_nodes(document)? {
        let local = local_transform(&locals[node])?;
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

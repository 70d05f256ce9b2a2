//! Nodes of the scene with their transforms, multiplied down the hierarchy in f64, and the placements of their lights.

use ::gltf::json::Value;
use ::gltf::scene::Transform;
use ::gltf::{Accessor, Document, Node, Scene};
use girandole::Placement;
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Mat3, Quat, Vec3};

use super::check::{NODE_VISIBILITY, document_error};
use super::load::GltfFile;
use super::read::Vectors;
use crate::error::{AssetError, invalid};

/// A rotation whose squared length is below this has no direction.
const MIN_ROTATION_LENGTH_SQ: f64 = 1e-12;
/// A determinant below this share of the product of the columns' lengths is zero but for rounding,
/// which is 2^-53 for each of some ten products.
const MAX_FLAT_DETERMINANT: f64 = 1e-12;

/// Where the lights of an instance come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightSource {
    /// The emissive triangles of the node's mesh, in the order of the primitives: one light each, or more of a
    /// primitive whose texture varies. A primitive with the accessors and the emission of an earlier one of its mesh adds no lights,
    /// since it covers the same surface. Triangles whose emissive texture is black add none.
    Surfaces,
    /// The node's point or spot light.
    Punctual,
    /// The node's lamp with a photometric profile, of EXT_lights_ies.
    Profile,
}

impl LightSource {
    /// The placement of lights at a transform, in the precision of a [`Placement`]. `None` if the transform is not finite.
    ///
    /// Scale counts for surfaces alone. A spot shines along -Z of the node; a lamp with a profile is also turned as +X of
    /// the node is. A transform that [`is_hidden`] gives a linear part of zero, so that the instance contributes nothing
    /// until it is moved.
    pub fn placement(self, transform: &DAffine3) -> Option<Placement> {
        if !transform.is_finite() {
            return None;
        }
        let (matrix, translation) = (transform.matrix3, transform.translation);
        if is_hidden(transform) {
            return Some(Placement { linear: Mat3::ZERO, translation });
        }
        let linear = match self {
            Self::Surfaces => matrix.as_mat3(),
            Self::Punctual => {
                let forward = (matrix * DVec3::NEG_Z).try_normalize()?.as_vec3();
                let rotation = Quat::from_rotation_arc(Vec3::NEG_Z, forward.normalize());
                DMat3::from_quat(rotation.as_dquat()).as_mat3()
            }
            Self::Profile => {
                let back = (matrix * DVec3::Z).try_normalize()?;
                let right = matrix * DVec3::X;
                let right = (right - back * right.dot(back)).try_normalize()?;
                DMat3::from_cols(right, back.cross(right), back).as_mat3()
            }
        };
        Some(Placement { linear, translation })
    }
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

/// An error that names the node of a transform.
pub(super) fn transform_error(node: usize) -> AssetError {
    invalid(format!("node {node}: its transform is not finite, or its rotation has no length"))
}

/// A rotation of unit length; `None` if it has no direction.
pub(super) fn rotation_of(rotation: [f64; 4]) -> Option<DQuat> {
    let rotation = DQuat::from_array(rotation);
    let length_sq = rotation.length_squared();
    (length_sq.is_finite() && length_sq >= MIN_ROTATION_LENGTH_SQ).then(|| rotation.normalize())
}

/// The transform of a node or an instance; `None` if it is not finite.
fn compose(translation: [f32; 3], rotation: [f32; 4], scale: [f32; 3]) -> Option<DAffine3> {
    let [translation, scale] = [translation, scale].map(|v| DVec3::from(v.map(f64::from)));
    let rotation = rotation_of(rotation.map(f64::from))?;
    Some(DAffine3::from_scale_rotation_translation(scale, rotation, translation)).filter(DAffine3::is_finite)
}

/// A node's transform to the space of its parent.
///
/// # Errors
/// [`AssetError::Invalid`] if the transform is not finite or its rotation has no length.
pub fn local_transform(node: &Node<'_>) -> Result<DAffine3, AssetError> {
    let local = match node.transform() {
        Transform::Matrix { matrix } => {
            let columns = matrix.map(|column| column.map(f64::from));
            Some(DAffine3::from_mat4(DMat4::from_cols_array_2d(&columns))).filter(DAffine3::is_finite)
        }
        Transform::Decomposed { translation, rotation, scale } => compose(translation, rotation, scale),
    };
    local.ok_or_else(|| transform_error(node.index()))
}

/// A node of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SceneNode {
    /// Index of the node in the document.
    pub node: usize,
    /// Index of its parent.
    pub parent: Option<usize>,
    /// To the world.
    pub transform: DAffine3,
    /// Whether neither the node nor one above it is hidden by KHR_node_visibility.
    pub is_visible: bool,
}

/// The default scene, else the first one.
pub(super) fn scene_of(document: &Document) -> Option<Scene<'_>> {
    document.default_scene().or_else(|| document.scenes().next())
}

/// The nodes of the document's scene, in depth-first order, parents before children.
///
/// The scene is the default scene, else the first scene. A document without scenes counts as one
/// scene of all nodes.
///
/// # Errors
/// [`AssetError::Invalid`] if a node has two parents or is its own ancestor, if a transform is not finite or its rotation
/// has no length, or if an extension KHR_node_visibility is not valid.
pub fn scene_nodes(document: &Document) -> Result<Vec<SceneNode>, AssetError> {
    let not_a_tree = |node: usize| invalid(format!("node {node} has two parents or is its own ancestor"));
    let scene = scene_of(document);
    let roots: Vec<usize> = match &scene {
        Some(scene) => scene.nodes().map(|node| node.index()).collect(),
        None => {
            let mut is_child = vec![false; document.nodes().len()];
            document.nodes().flat_map(|node| node.children()).for_each(|child| is_child[child.index()] = true);
            (0..is_child.len()).filter(|&node| !is_child[node]).collect()
        }
    };
    let nodes: Vec<Node<'_>> = document.nodes().collect();
    let mut visited = vec![false; nodes.len()];
    let mut order: Vec<SceneNode> = Vec::with_capacity(nodes.len());
    // Nodes, and the places of their parents in the order.
    let mut stack: Vec<(usize, Option<usize>)> = roots.into_iter().rev().map(|node| (node, None)).collect();
    while let Some((node, parent)) = stack.pop() {
        if std::mem::replace(&mut visited[node], true) {
            return Err(not_a_tree(node));
        }
        let parent = parent.map(|place| order[place]);
        let local = local_transform(&nodes[node])?;
        let transform = parent.map_or(local, |parent| parent.transform * local);
        if !transform.is_finite() {
            return Err(transform_error(node));
        }
        let is_visible = is_visible(&nodes[node])? && parent.is_none_or(|parent| parent.is_visible);
        let (place, first) = (order.len(), stack.len());
        order.push(SceneNode { node, parent: parent.map(|parent| parent.node), transform, is_visible });
        stack.extend(nodes[node].children().map(|child| (child.index(), Some(place))));
        stack[first..].reverse();
    }
    // Without scenes every node hangs from a node without a parent, unless it is part of a cycle.
    match visited.iter().position(|visited| !visited) {
        Some(node) if scene.is_none() => Err(not_a_tree(node)),
        _ => Ok(order),
    }
}

/// Whether a node's own extension does not hide it.
fn is_visible(node: &Node<'_>) -> Result<bool, AssetError> {
    let value = node.extension_value(NODE_VISIBILITY).and_then(|extension| extension.get("visible"));
    value
        .map_or(Some(true), Value::as_bool)
        .ok_or_else(|| document_error(&format!("node {}: {NODE_VISIBILITY} is neither true nor false", node.index())))
}

/// The transforms of a node's instances to the space of the node, read on demand: one for a node without the extension.
pub(super) fn instances<'a>(
    file: &'a GltfFile,
    node: &Node<'_>,
) -> Result<impl Iterator<Item = Result<DAffine3, AssetError>> + use<'a>, AssetError> {
    let index = node.index();
    let invalid = |what: &str| document_error(&format!("node {index}: EXT_mesh_gpu_instancing {what}"));
    let extension = node.extension_value("EXT_mesh_gpu_instancing");
    let accessor = |name: &str| {
        let Some(value) = extension.and_then(|extension| extension.get("attributes")?.get(name)) else {
            return Ok(None);
        };
        let accessor = index_of(value).and_then(|index| file.document.accessors().nth(index));
        accessor.ok_or_else(|| invalid("refers to no accessor")).map(Some)
    };
    let vectors = |name: &str| vectors_of::<3>(accessor(name)?, file);
    let (translations, scales) = (vectors("TRANSLATION")?, vectors("SCALE")?);
    let rotations = vectors_of::<4>(accessor("ROTATION")?, file)?;
    let counts = [&translations, &scales].into_iter().flatten().map(Vectors::count);
    let counts: Vec<usize> = counts.chain(rotations.as_ref().map(Vectors::count)).collect();
    let count = match counts.first() {
        Some(first) if counts.iter().any(|count| count != first) => {
            return Err(invalid("has attributes of different lengths"));
        }
        Some(first) => *first,
        None if extension.is_some() => return Err(invalid("has no transforms")),
        None => 1,
    };
    Ok((0..count).map(move |place| {
        let translation = translations.as_ref().map_or([0.0; 3], |found| found.get(place));
        let rotation = rotations.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |found| found.get(place));
        let scale = scales.as_ref().map_or([1.0; 3], |found| found.get(place));
        compose(translation, rotation, scale).ok_or_else(|| transform_error(index))
    }))
}

fn vectors_of<'a, const N: usize>(
    accessor: Option<Accessor<'_>>,
    file: &'a GltfFile,
) -> Result<Option<Vectors<'a, N>>, AssetError> {
    accessor.map(|accessor| Vectors::new(&accessor, &file.buffers)).transpose()
}

/// An index in the JSON of an extension.
pub(super) fn index_of(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|index| usize::try_from(index).ok())
}

/// The transforms of the instances of a node's mesh to the space of the node: those of
/// EXT_mesh_gpu_instancing, or else the identity alone.
///
/// # Errors
/// [`AssetError::Invalid`] for an extension or transforms that are not valid, and as for
/// [`accessor_values`](super::accessor_values).
///
/// # Cost
/// Linear in the instances, whose number is that of the elements of an accessor.
pub fn node_instances(file: &GltfFile, node: &Node<'_>) -> Result<Vec<DAffine3>, AssetError> {
    instances(file, node)?.collect()
}

//! Which object and which lights belong to each node of a glTF scene.

use girandole::glam::{Affine3A, DAffine3};
use girandole::gltf::GltfLights;
use girandole::gltf::gltf::Document;

/// The objects and lights that move with each node.
#[derive(Clone, Debug)]
pub struct NodeMap {
    /// The object of each node that has a mesh and is part of the scene.
    pub objects: Vec<Option<usize>>,
    /// The instances and directional lights of the nodes.
    pub lights: GltfLights,
}

impl NodeMap {
    /// `node_objects` are pairs of a node and its object.
    pub fn new(document: &Document, node_objects: &[(usize, usize)], lights: &GltfLights) -> Self {
        let mut objects = vec![None; document.nodes().len()];
        node_objects.iter().for_each(|&(node, object)| objects[node] = Some(object));
        Self { objects, lights: lights.clone() }
    }
}

/// A transform in single precision, as objects have it.
pub fn to_single(transform: DAffine3) -> Affine3A {
    Affine3A::from_mat3_translation(transform.matrix3.as_mat3(), transform.translation.as_vec3())
}

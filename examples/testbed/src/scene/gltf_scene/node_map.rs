//! Which objects and which lights belong to each node of a glTF scene.

use girandole::glam::{Affine3A, DAffine3, Mat3A};
use girandole_assets::gltf::gltf::Document;
use girandole_assets::gltf::{GltfLights, is_hidden};

/// An object of a node.
#[derive(Clone, Copy, Debug)]
pub struct NodeObject {
    /// Index of the node.
    pub node: usize,
    /// Index of the object.
    pub object: usize,
    /// The transform of the object to the space of the node: the identity, unless the node places its
    /// mesh many times.
    pub local: DAffine3,
}

/// The objects and lights that move with each node.
#[derive(Clone, Debug)]
pub struct NodeMap {
    /// The objects of each node that has a mesh and is part of the scene.
    pub objects: Vec<Vec<NodeObject>>,
    /// The instances and directional lights of the nodes.
    pub lights: GltfLights,
}

impl NodeMap {
    /// Sorts objects by their nodes.
    pub fn new(document: &Document, node_objects: &[NodeObject], lights: &GltfLights) -> Self {
        let mut objects = vec![Vec::new(); document.nodes().len()];
        node_objects.iter().for_each(|object| objects[object.node].push(*object));
        Self { objects, lights: lights.clone() }
    }

    /// The object of a node that has exactly one.
    pub fn only_object(&self, node: usize) -> Option<usize> {
        match self.objects[node][..] {
            [only] => Some(only.object),
            _ => None,
        }
    }
}

/// A transform in single precision, as objects have it. Those that hide their node become all zero.
pub fn to_single(transform: DAffine3) -> Affine3A {
    let translation = transform.translation.as_vec3();
    if is_hidden(&transform) {
        return Affine3A { matrix3: Mat3A::ZERO, translation: translation.into() };
    }
    Affine3A::from_mat3_translation(transform.matrix3.as_mat3(), translation)
}

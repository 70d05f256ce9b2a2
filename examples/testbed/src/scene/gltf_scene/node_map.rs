//! Which objects and which lights belong to each node of a glTF scene, and moves them.

use girandole::glam::{Affine3A, DAffine3, DVec3, Mat3A};
use girandole::{DirectionalLight, LightWorld};
use girandole_assets::gltf::{GltfLights, is_hidden};

use super::{Scene, SceneError};

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

/// The objects and lights of all nodes.
#[derive(Clone, Debug)]
pub struct NodeMap {
    /// The objects.
    pub objects: Vec<NodeObject>,
    /// The instances and directional lights.
    pub lights: GltfLights,
}

impl NodeMap {
    /// Moves what belongs to the nodes for which `transform` has one, from the space of the node to the world.
    pub fn place(
        &self,
        transform: impl Fn(usize) -> Option<DAffine3>,
        scene: &mut Scene,
        world: &mut LightWorld,
    ) -> Result<(), SceneError> {
        for object in &self.objects {
            if let Some(transform) = transform(object.node) {
                scene.objects[object.object].transform = to_single(transform * object.local);
            }
        }
        for lights in &self.lights.nodes {
            let placement = |transform| lights.source.placement(&(transform * lights.local));
            if let Some(placement) = transform(lights.node).and_then(placement) {
                world.move_instance(lights.instance, placement)?;
            }
        }
        for (node, key) in &self.lights.directional {
            let direction = transform(*node).and_then(|moved| (moved.matrix3 * DVec3::NEG_Z).try_normalize());
            if let (Some(direction), Some(light)) = (direction, world.directional(*key).copied()) {
                world.set_directional(*key, DirectionalLight { direction: direction.as_vec3(), ..light })?;
            }
        }
        Ok(())
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

//! EXT_mesh_gpu_instancing: nodes that place their mesh many times.

use ::gltf::Document;
use ::gltf::Node;
use ::gltf::json::Value;
use glam::{DAffine3, DQuat, DVec3};

use super::error::{GltfError, document_error};
use super::nodes::MIN_ROTATION_LENGTH_SQ;
use super::read::Vectors;

/// The transforms of a node's instances to the space of the node, read on demand.
pub(super) struct Instances<'a> {
    node: usize,
    count: usize,
    translations: Option<Vectors<'a, 3>>,
    rotations: Option<Vectors<'a, 4>>,
    scales: Option<Vectors<'a, 3>>,
}

impl<'a> Instances<'a> {
    /// One instance for a node without the extension.
    pub fn new<B: AsRef<[u8]>>(document: &Document, node: &Node<'_>, buffers: &'a [B]) -> Result<Self, GltfError> {
        let mut instances = Self { node: node.index(), count: 1, translations: None, rotations: None, scales: None };
        let Some(extension) = node.extension_value("EXT_mesh_gpu_instancing") else { return Ok(instances) };
        let invalid = |what: &str| document_error(&format!("node {}: EXT_mesh_gpu_instancing {what}", instances.node));
        let Some(attributes) = extension.get("attributes").and_then(Value::as_object) else {
            return Err(invalid("has no attributes"));
        };
        let mut counts = Vec::new();
        for (name, value) in attributes {
            // Attributes that begin with an underscore belong to the application.
            if !matches!(name.as_str(), "TRANSLATION" | "ROTATION" | "SCALE") {
                continue;
            }
            let index = value.as_u64().and_then(|index| usize::try_from(index).ok());
            let accessor = index.and_then(|index| document.accessors().nth(index));
            let Some(accessor) = accessor else { return Err(invalid("refers to no accessor")) };
            counts.push(accessor.count());
            match name.as_str() {
                "TRANSLATION" => instances.translations = Some(Vectors::new(&accessor, buffers)?),
                "ROTATION" => instances.rotations = Some(Vectors::new(&accessor, buffers)?),
                _ => instances.scales = Some(Vectors::new(&accessor, buffers)?),
            }
        }
        match counts.first() {
            Some(&count) if counts.iter().all(|other| *other == count) => instances.count = count,
            Some(_) => return Err(invalid("has attributes of different lengths")),
            None => return Err(invalid("has no transforms")),
        }
        Ok(instances)
    }

    pub fn count(&self) -> usize {
        self.count
    }

    pub fn iter(&self) -> impl Iterator<Item = Result<DAffine3, GltfError>> {
        (0..self.count).map(|index| self.get(index))
    }

    fn get(&self, index: usize) -> Result<DAffine3, GltfError> {
        let vector = |vectors: &Option<Vectors<'_, 3>>, default: DVec3| {
            vectors.as_ref().map_or(default, |vectors| DVec3::from(vectors.get(index).map(f64::from)))
        };
        let invalid = GltfError::Transform { node: self.node };
        let rotation = match &self.rotations {
            Some(rotations) => DQuat::from_array(rotations.get(index).map(f64::from)),
            None => DQuat::IDENTITY,
        };
        if !rotation.is_finite() || rotation.length_squared() < MIN_ROTATION_LENGTH_SQ {
            return Err(invalid);
        }
        let (scale, translation) = (vector(&self.scales, DVec3::ONE), vector(&self.translations, DVec3::ZERO));
        let transform = DAffine3::from_scale_rotation_translation(scale, rotation.normalize(), translation);
        if transform.is_finite() { Ok(transform) } else { Err(invalid) }
    }
}

/// The transforms of the instances of a node's mesh to the space of the node: those of
/// EXT_mesh_gpu_instancing, or else the identity alone.
///
/// # Errors
/// [`GltfError::Document`] if the extension is not valid, [`GltfError::Transform`], and those of
/// [`accessor_values`](super::accessor_values).
///
/// # Cost
/// Linear in the instances, whose number is that of the elements of an accessor.
pub fn node_instances<B: AsRef<[u8]>>(
    document: &Document,
    node: &Node<'_>,
    buffers: &[B],
) -> Result<Vec<DAffine3>, GltfError> {
    Instances::new(document, node, buffers)?.iter().collect()
}

//! EXT_lights_ies: nodes that are lamps with photometric profiles.

use std::path::Path;

use ::gltf::json::{Root, Value};
use ::gltf::{Document, Node};
use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::budget::Budget;
use super::check::LIGHTS_IES as NAME;
use super::error::{GltfError, document_error, shortened};
use super::files::{file_length, read};
use super::nodes::{is_hidden, surface_placement};
use super::read::view_bytes;
use super::uri::{Location, decode_base64, encode_base64};
use crate::instance::placement::Placement;
use crate::profile::Profile;

/// What a node says about its lamp.
pub(super) struct Lamp {
    /// The index of its profile.
    pub profile: usize,
    /// Of the candela of the profile.
    pub factor: Vec3,
}

impl Lamp {
    /// The lamp of a node, if it has one.
    pub fn of(node: &Node<'_>) -> Result<Option<Self>, GltfError> {
        let Some(extension) = node.extension_value(NAME) else { return Ok(None) };
        let invalid = |what: &str| document_error(&format!("node {}: {NAME} {what}", node.index()));
        let index = extension.get("light").and_then(Value::as_u64).and_then(|index| usize::try_from(index).ok());
        let profile = index.ok_or_else(|| invalid("has no light"))?;
        let number = |value: &Value| value.as_f64().filter(|number| *number >= 0.0).map(|number| number as f32);
        let multiplier = extension.get("multiplier").map_or(Some(1.0), number);
        let channels = extension.get("color").map_or(Some(Vec3::ONE), |color| {
            let channels: Option<Vec<f32>> = color.as_array()?.iter().map(number).collect();
            Some(Vec3::from_array(channels?.try_into().ok()?).min(Vec3::ONE))
        });
        match (multiplier, channels) {
            (Some(multiplier), Some(color)) => Ok(Some(Self { profile, factor: color * multiplier })),
            (None, _) => Err(invalid("has a multiplier that is no number of 0 or more")),
            (_, None) => Err(invalid("has a color that is not three numbers of 0 or more")),
        }
    }
}

/// Reads a profile of a document: from a view of a buffer, or from a data URI.
pub(super) fn read_profile<B: AsRef<[u8]>>(
    document: &Document,
    buffers: &[B],
    index: usize,
) -> Result<Profile, GltfError> {
    let refused = |message: String| GltfError::Profile { profile: index, message };
    let lights = document.extension_value(NAME).and_then(|extension| extension.get("lights")?.as_array());
    let Some(light) = lights.and_then(|lights| lights.get(index)) else {
        return Err(refused("the document has no such profile".into()));
    };
    let parsed = |file: &[u8]| Profile::ies(file).map_err(|error| refused(error.to_string()));
    if let Some(uri) = light.get("uri").and_then(Value::as_str) {
        let refused_uri = |what: &str| refused(format!("its URI {what}: {}", shortened(uri)));
        return match Location::of(uri).map_err(refused_uri)? {
            Location::Inline(text) => parsed(&decode_base64(text).map_err(refused_uri)?),
            Location::File(_) => Err(refused_uri("is that of a file, and the folder of the document is unknown")),
        };
    }
    let view = light.get("bufferView").and_then(Value::as_u64).and_then(|view| usize::try_from(view).ok());
    let view = view.and_then(|view| document.views().nth(view));
    let view = view.ok_or_else(|| refused("it has neither a URI nor a view of a buffer".into()))?;
    parsed(view_bytes(&view, buffers).ok_or_else(|| refused("its view is beyond its buffer".into()))?)
}

/// Reads the profiles of a document that are files, and puts them into it as data URIs.
pub(super) fn add_files(root: &mut Root, folder: &Path, budget: &mut Budget) -> Result<(), GltfError> {
    let lights = root.extensions.as_mut().and_then(|extensions| extensions.others.get_mut(NAME)?.get_mut("lights"));
    for (profile, light) in lights.and_then(Value::as_array_mut).into_iter().flatten().enumerate() {
        let Some(uri) = light.get_mut("uri") else { continue };
        let Some(text) = uri.as_str() else { continue };
        let refused = |what| GltfError::Profile { profile, message: format!("its URI {what}: {}", shortened(text)) };
        if let Location::File(path) = Location::of(text).map_err(refused)? {
            let path = folder.join(path);
            let bytes = read(&path, file_length(&path)?, budget)?;
            // Four characters for three bytes, and as many again in between.
            budget.take(3 * bytes.len() as u64)?;
            *uri = Value::String(encode_base64(&bytes));
        }
    }
    Ok(())
}

/// The placement of a node's lamp with a profile. Scale and mirroring of the node are ignored: -Z and +X of
/// the node decide how the lamp is turned.
///
/// A transform that [`is_hidden`] gives a linear part of zero, so that the instance contributes
/// nothing until it is moved. Returns `None` if the transform is not finite.
pub fn profile_placement(transform: &DAffine3) -> Option<Placement> {
    if !transform.is_finite() {
        return None;
    }
    if is_hidden(transform) {
        return Some(surface_placement(transform));
    }
    let back = (transform.matrix3 * DVec3::Z).try_normalize()?;
    let right = transform.matrix3 * DVec3::X;
    let right = (right - back * right.dot(back)).try_normalize()?;
    let linear = DMat3::from_cols(right, back.cross(right), back);
    Some(DAffine3::from_mat3_translation(linear, transform.translation).into())
}

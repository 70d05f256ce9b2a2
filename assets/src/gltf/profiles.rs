//! EXT_lights_ies: nodes that are lamps with photometric profiles.

use ::gltf::Node;
use ::gltf::json::Value;
use girandole::Profile;
use glam::Vec3;

use super::check::{LIGHTS_IES as NAME, document_error};
use super::files::Files;
use super::load::GltfFile;
use super::nodes::index_of;
use crate::error::{AssetError, invalid};
use crate::profile;

/// What a node says about its lamp.
pub(super) struct Lamp {
    /// The index of its profile.
    pub profile: usize,
    /// Of the candela of the profile.
    pub factor: Vec3,
}

impl Lamp {
    /// The lamp of a node, if it has one.
    pub fn of(node: &Node<'_>) -> Result<Option<Self>, AssetError> {
        let Some(extension) = node.extension_value(NAME) else { return Ok(None) };
        let invalid = |what: &str| document_error(&format!("node {}: {NAME} {what}", node.index()));
        let profile = extension.get("light").and_then(index_of).ok_or_else(|| invalid("has no light"))?;
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

/// Reads a profile of a document: from a URI, or from a view of a buffer.
pub(super) fn read_profile(file: &GltfFile, index: usize, files: &mut Files<'_>) -> Result<Profile, AssetError> {
    let owner = format!("profile {index}");
    let refused = |what: &str| invalid(format!("{owner}: {what}"));
    let lights = file.document.extension_value(NAME).and_then(|extension| extension.get("lights")?.as_array());
    let light =
        lights.and_then(|lights| lights.get(index)).ok_or_else(|| refused("the document has no such profile"))?;
    let bytes = match light.get("uri").and_then(Value::as_str) {
        Some(uri) => files.at_uri(&owner, uri, u64::MAX)?,
        None => {
            let view = light.get("bufferView").and_then(index_of).and_then(|view| file.document.views().nth(view));
            let view = view.ok_or_else(|| refused("it has neither a URI nor a view of a buffer"))?;
            files.in_view(&owner, &view, &file.buffers)?
        }
    };
    profile::ies(&bytes).map_err(|error| refused(&error.to_string()))
}

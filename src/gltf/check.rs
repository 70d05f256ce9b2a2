//! Checks of documents that the gltf crate leaves out. It panics or takes quadratic time where they
//! fail.

use ::gltf::Semantic;
use ::gltf::json::camera::Type;
use ::gltf::json::extensions::ENABLED_EXTENSIONS;
use ::gltf::json::validation::{Checked, Validate};
use ::gltf::json::{Accessor, Asset, Index, Path, Root, Value};

use super::error::{GltfError, document_error, shortened};

/// Extensions that the library reads itself or that change no light, and the gltf crate does not know.
const OWN_EXTENSIONS: [&str; 7] = [
    "KHR_mesh_quantization",
    "EXT_mesh_gpu_instancing",
    "KHR_materials_unlit",
    NODE_VISIBILITY,
    WEBP,
    LIGHTS_IES,
    LIGHTS_IMAGE_BASED,
];
/// The extension by which nodes are hidden.
pub(super) const NODE_VISIBILITY: &str = "KHR_node_visibility";
/// The extension by which textures have WebP images. Those without another image have it in the extension.
const WEBP: &str = "EXT_texture_webp";
/// The extension of lamps with photometric profiles.
pub(super) const LIGHTS_IES: &str = "EXT_lights_ies";
/// The extension of scenes with the light of their surroundings.
pub(super) const LIGHTS_IMAGE_BASED: &str = "EXT_lights_image_based";
/// The extension of compressed primitives, which is not read.
const DRACO: &str = "KHR_draco_mesh_compression";
/// Names of extensions in an error.
const MAX_NAMES: usize = 16;

/// Checks a document, then validates it.
///
/// What passes can be read through all of the gltf crate but its readers of accessors.
pub(super) fn check(root: &mut Root) -> Result<(), GltfError> {
    check_version(&root.asset)?;
    check_extensions(&root.extensions_required)?;
    check_bounds(root)?;
    check_positions(root)?;
    check_compression(root)?;
    check_animations(root)?;
    check_cameras(root)?;
    check_images(root)?;
    add_webp_sources(root);
    // The crate's validation refuses what it does not know. All required extensions passed above.
    let required = std::mem::take(&mut root.extensions_required);
    // Only the first error is kept: a small file can have a great many.
    let mut first = None;
    root.validate(root, Path::new, &mut |path, error| {
        first.get_or_insert_with(|| format!("{}: {error}", path()));
    });
    root.extensions_required = required;
    first.map_or(Ok(()), |message| Err(document_error(&message)))
}

/// Refuses documents of other versions than 2, and those that need a reader of a later version than 2.0.
pub(super) fn check_version(asset: &Asset) -> Result<(), GltfError> {
    let needed = asset.min_version.as_deref().unwrap_or("2.0");
    let what = if !asset.version.starts_with("2.") {
        format!("version is {:?}; only 2.x is supported (gltf-pipeline converts files)", shortened(&asset.version))
    } else if !["1.0", "2.0"].contains(&needed) {
        format!("minVersion is {:?}; readers of 2.0 are supported", shortened(needed))
    } else {
        return Ok(());
    };
    Err(document_error(&format!("its {what}")))
}

/// Refuses required extensions that are not supported: all of them in one error, each once.
pub(super) fn check_extensions(required: &[String]) -> Result<(), GltfError> {
    let is_supported = |name: &str| ENABLED_EXTENSIONS.contains(&name) || OWN_EXTENSIONS.contains(&name);
    let mut names: Vec<String> = Vec::new();
    for name in required.iter().filter(|name| !is_supported(name)) {
        let name = shortened(name);
        if !names.contains(&name) && names.len() < MAX_NAMES {
            names.push(name);
        }
    }
    if names.is_empty() { Ok(()) } else { Err(GltfError::UnsupportedExtensions { names }) }
}

/// The gltf crate's validation copies the bounds of an accessor for each primitive that uses it.
/// glTF allows 1 to 16 numbers.
fn check_bounds(root: &Root) -> Result<(), GltfError> {
    let is_valid = |bounds: &Value| bounds.as_array().is_some_and(|b| b.len() <= 16 && b.iter().all(Value::is_number));
    for (index, accessor) in root.accessors.iter().enumerate() {
        if ![&accessor.min, &accessor.max].into_iter().flatten().all(is_valid) {
            return Err(document_error(&format!("accessor {index}: its bounds are not up to 16 numbers")));
        }
    }
    Ok(())
}

/// The gltf crate's validation looks up the accessor of a primitive's positions without a check.
fn check_positions(root: &Root) -> Result<(), GltfError> {
    for (index, mesh) in root.meshes.iter().enumerate() {
        for primitive in &mesh.primitives {
            let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
            if positions.is_some_and(|accessor| accessor.value() >= root.accessors.len()) {
                return Err(document_error(&format!(
                    "mesh {index}: the positions of a primitive refer to no accessor"
                )));
            }
        }
    }
    Ok(())
}

/// The gltf crate's validation names the accessors of compressed primitives without other data, but not the cause.
fn check_compression(root: &Root) -> Result<(), GltfError> {
    let is_empty = |accessor: &Index<Accessor>| {
        root.accessors.get(accessor.value()).is_some_and(|found| found.buffer_view.is_none() && found.sparse.is_none())
    };
    for (index, mesh) in root.meshes.iter().enumerate() {
        for primitive in &mesh.primitives {
            let is_compressed = primitive.extensions.as_ref().is_some_and(|found| found.others.contains_key(DRACO));
            if is_compressed && primitive.attributes.values().chain(&primitive.indices).any(is_empty) {
                return Err(document_error(&format!("mesh {index}: a primitive has no data but those of {DRACO}")));
            }
        }
    }
    Ok(())
}

/// The gltf crate's validation leaves out the targets of animations. Channels of properties that glTF does not have
/// belong to extensions, and are left out.
fn check_animations(root: &mut Root) -> Result<(), GltfError> {
    for animation in &mut root.animations {
        animation.channels.retain(|channel| matches!(channel.target.path, Checked::Valid(_)));
    }
    for (index, animation) in root.animations.iter().enumerate() {
        let mut is_valid = true;
        for channel in &animation.channels {
            channel.target.validate(root, Path::new, &mut |_, _| is_valid = false);
        }
        if !is_valid {
            return Err(document_error(&format!("animation {index}: a channel has an invalid target")));
        }
    }
    Ok(())
}

/// The gltf crate's validation accepts a camera that has only the projection of the other type.
fn check_cameras(root: &Root) -> Result<(), GltfError> {
    for (index, camera) in root.cameras.iter().enumerate() {
        let has_projection = match camera.type_ {
            Checked::Valid(Type::Perspective) => camera.perspective.is_some(),
            Checked::Valid(Type::Orthographic) => camera.orthographic.is_some(),
            Checked::Invalid => false,
        };
        if !has_projection {
            return Err(document_error(&format!("camera {index} has no projection of its type")));
        }
    }
    Ok(())
}

/// The gltf crate reads the image of a texture only from outside of extensions, and requires one.
fn add_webp_sources(root: &mut Root) {
    for texture in root.textures.iter_mut().filter(|texture| texture.source.value() == u32::MAX as usize) {
        let webp =
            texture.extensions.as_ref().and_then(|extensions| extensions.others.get(WEBP)?.get("source")?.as_u64());
        if let Some(source) = webp.and_then(|source| u32::try_from(source).ok()) {
            texture.source = Index::new(source);
        }
    }
}

/// The gltf crate's validation accepts images without a source, and sources without their type.
fn check_images(root: &Root) -> Result<(), GltfError> {
    for (index, image) in root.images.iter().enumerate() {
        let has_source = match image.buffer_view {
            Some(_) => image.mime_type.is_some(),
            None => image.uri.is_some(),
        };
        if !has_source {
            return Err(document_error(&format!("image {index} has no source, or one of no type")));
        }
    }
    Ok(())
}

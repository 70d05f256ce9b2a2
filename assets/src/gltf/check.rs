//! Checks of documents that the gltf crate leaves out. It panics or takes quadratic time where they
//! fail.

use ::gltf::Semantic;
use ::gltf::json::camera::Type;
use ::gltf::json::extensions::ENABLED_EXTENSIONS;
use ::gltf::json::validation::{Checked, Validate};
use ::gltf::json::{Accessor, Animation, Asset, Camera, Image, Index, Mesh, Path, Root, Value};

use crate::error::{AssetError, invalid, shortened};

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
pub(super) fn check(root: &mut Root) -> Result<(), AssetError> {
    check_version(&root.asset)?;
    check_extensions(&root.extensions_required)?;
    // Channels of properties that glTF does not have belong to extensions.
    for animation in &mut root.animations {
        animation.channels.retain(|channel| matches!(channel.target.path, Checked::Valid(_)));
    }
    if let Some(fault) = first_fault(root) {
        return Err(document_error(&fault));
    }
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

/// An error in a document. Its message is shortened, since it may hold text of the file.
pub(super) fn document_error(message: &str) -> AssetError {
    invalid(format!("not a valid glTF file: {}", shortened(message)))
}

/// Refuses documents of other versions than 2, and those that need a reader of a later version than 2.0.
pub(super) fn check_version(asset: &Asset) -> Result<(), AssetError> {
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
pub(super) fn check_extensions(required: &[String]) -> Result<(), AssetError> {
    let is_supported = |name: &str| ENABLED_EXTENSIONS.contains(&name) || OWN_EXTENSIONS.contains(&name);
    let mut names: Vec<String> = Vec::new();
    for name in required.iter().filter(|name| !is_supported(name)) {
        let name = shortened(name);
        if !names.contains(&name) && names.len() < MAX_NAMES {
            names.push(name);
        }
    }
    if names.is_empty() { Ok(()) } else { Err(AssetError::Extensions { names }) }
}

/// What the gltf crate's validation leaves out.
fn first_fault(root: &Root) -> Option<String> {
    let faults = [
        ("accessor", root.accessors.iter().position(has_wrong_bounds), "its bounds are not up to 16 numbers"),
        (
            "mesh",
            root.meshes.iter().position(|mesh| has_unknown_positions(root, mesh)),
            "the positions of a primitive refer to no accessor",
        ),
        (
            "mesh",
            root.meshes.iter().position(|mesh| is_only_compressed(root, mesh)),
            "a primitive has no data but those of KHR_draco_mesh_compression",
        ),
        (
            "animation",
            root.animations.iter().position(|animation| has_wrong_target(root, animation)),
            "a channel has an invalid target",
        ),
        ("camera", root.cameras.iter().position(lacks_projection), "it has no projection of its type"),
        ("image", root.images.iter().position(lacks_source), "it has no source, or one of no type"),
    ];
    faults.into_iter().find_map(|(kind, index, fault)| Some(format!("{kind} {}: {fault}", index?)))
}

/// The validation copies the bounds of an accessor for each primitive that uses it. glTF allows 1 to 16 numbers.
fn has_wrong_bounds(accessor: &Accessor) -> bool {
    let is_valid = |bounds: &Value| bounds.as_array().is_some_and(|b| b.len() <= 16 && b.iter().all(Value::is_number));
    ![&accessor.min, &accessor.max].into_iter().flatten().all(is_valid)
}

/// The validation looks up the accessor of a primitive's positions without a check.
fn has_unknown_positions(root: &Root, mesh: &Mesh) -> bool {
    let positions = mesh.primitives.iter().filter_map(|primitive| {
        primitive.attributes.get(&Checked::Valid(Semantic::Positions)).map(|accessor| accessor.value())
    });
    positions.into_iter().any(|accessor| accessor >= root.accessors.len())
}

/// The validation names the accessors of compressed primitives without other data, but not the cause.
fn is_only_compressed(root: &Root, mesh: &Mesh) -> bool {
    let is_empty = |accessor: &Index<Accessor>| {
        root.accessors.get(accessor.value()).is_some_and(|found| found.buffer_view.is_none() && found.sparse.is_none())
    };
    mesh.primitives.iter().any(|primitive| {
        let is_compressed = primitive.extensions.as_ref().is_some_and(|found| found.others.contains_key(DRACO));
        is_compressed && primitive.attributes.values().chain(&primitive.indices).any(is_empty)
    })
}

/// The validation leaves out the targets of animations.
fn has_wrong_target(root: &Root, animation: &Animation) -> bool {
    let mut is_wrong = false;
    for channel in &animation.channels {
        channel.target.validate(root, Path::new, &mut |_, _| is_wrong = true);
    }
    is_wrong
}

/// The validation accepts a camera that has only the projection of the other type.
fn lacks_projection(camera: &Camera) -> bool {
    match camera.type_ {
        Checked::Valid(Type::Perspective) => camera.perspective.is_none(),
        Checked::Valid(Type::Orthographic) => camera.orthographic.is_none(),
        Checked::Invalid => true,
    }
}

/// The validation accepts images without a source, and sources without their type.
fn lacks_source(image: &Image) -> bool {
    match image.buffer_view {
        Some(_) => image.mime_type.is_none(),
        None => image.uri.is_none(),
    }
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

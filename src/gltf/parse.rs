//! Parses files, and refuses those on which the gltf crate panics.

use ::gltf::json::validation::{Checked, Validate};
use ::gltf::json::{Path, Root};
use ::gltf::{Document, Gltf, Semantic};

use super::error::GltfError;

/// Bytes of a binary file's header and of the header of its first chunk.
const MIN_BINARY_LENGTH: usize = 20;

/// Parses and validates a .gltf or .glb file.
///
/// Prefer this to [`Gltf::from_slice`], which panics on a .glb whose stated length is less than its
/// header and on positions that refer to no accessor, and accepts animations of nodes that do not
/// exist.
///
/// # Errors
/// [`GltfError::Document`].
pub fn parse(bytes: &[u8]) -> Result<Gltf, GltfError> {
    check_binary_length(bytes)?;
    let invalid = |error: ::gltf::Error| document_error(&error.to_string());
    let Gltf { document, blob } = Gltf::from_slice_without_validation(bytes).map_err(invalid)?;
    check_positions(document.as_json())?;
    check_animations(document.as_json())?;
    let document = Document::from_json(document.into_json()).map_err(invalid)?;
    Ok(Gltf { document, blob })
}

/// An error with a message of one line.
fn document_error(message: &str) -> GltfError {
    let lines: Vec<&str> = message.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    GltfError::Document { message: lines.join(" ") }
}

/// The gltf crate subtracts the size of the header from the stated length without a check.
fn check_binary_length(bytes: &[u8]) -> Result<(), GltfError> {
    if !bytes.starts_with(b"glTF") {
        return Ok(());
    }
    let stated = bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    match stated {
        Some(length) if length < MIN_BINARY_LENGTH => {
            Err(document_error(&format!("its header states a length of {length} bytes")))
        }
        Some(length) if length > bytes.len() => {
            Err(document_error(&format!("it is truncated: {} of {length} bytes", bytes.len())))
        }
        Some(_) => Ok(()),
        None => Err(document_error("it is truncated within its header")),
    }
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

/// The gltf crate's validation leaves out the targets of animations, and panics when they are read.
fn check_animations(root: &Root) -> Result<(), GltfError> {
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

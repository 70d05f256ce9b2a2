//! Parses files, and refuses those on which the gltf crate panics or takes too much memory.

use std::borrow::Cow;
use std::collections::BTreeMap;

use ::gltf::binary::Glb;
use ::gltf::json::{Asset, Extras, Root, Value, deserialize};
use ::gltf::{Document, Gltf};

use super::check::{check, check_extensions, check_version, document_error};
use super::files::Files;
use super::options::GltfOptions;
use crate::error::AssetError;

/// Bytes of a binary file's header and of the header of its first chunk.
const MIN_BINARY_LENGTH: u32 = 20;

/// The most memory that parsing takes for a JSON object, in bytes: twice the largest record of the
/// gltf crate, since lists grow by doubling, or the smallest map.
const OBJECT_BYTES: u64 = 1280;
/// The most memory for any other value, which is a list or has a comma beside it. An entry of an
/// extension takes most: it is read into a list of pairs, and from there into a map.
const VALUE_BYTES: u64 = 256;

/// Parses and validates a .gltf or .glb file, without its buffers.
///
/// [`load`](super::load) also reads the buffers. Call this where they are read in another way, and then
/// [`GltfFile::new`](super::GltfFile::new). Do not call [`Gltf::from_slice`] on files of unknown
/// origin. It panics on a .glb whose stated length is less than its header and on positions that
/// refer to no accessor. It takes quadratic time on accessors with long bounds. It accepts animations
/// of nodes that do not exist, cameras without their projection and images without a source, and
/// panics when these are read.
///
/// No bytes make this function panic. Its memory is limited by
/// [`GltfOptions::max_bytes`](GltfOptions::max_bytes), and its time is linear in the bytes.
///
/// # Errors
/// [`AssetError::Extensions`], [`AssetError::Invalid`], [`AssetError::Limit`].
pub fn parse(bytes: &[u8], options: &GltfOptions) -> Result<Gltf, AssetError> {
    parse_within(bytes, &mut Files::new(None, options))
}

/// The same, with the memory taken from a limit: that of the document by estimate, and that of the
/// binary chunk.
pub(super) fn parse_within(bytes: &[u8], files: &mut Files<'_>) -> Result<Gltf, AssetError> {
    let (json, bin) = if bytes.starts_with(b"glTF") {
        // The gltf crate subtracts the size of the header from the stated length without a check.
        let stated = bytes.get(8..12).and_then(|length| length.try_into().ok()).map_or(0, u32::from_le_bytes);
        if stated < MIN_BINARY_LENGTH {
            return Err(document_error(&format!("its header states a length of {stated} bytes")));
        }
        let glb = Glb::from_slice(bytes).map_err(|error| document_error(&error.to_string()))?;
        (glb.json, glb.bin)
    } else {
        (Cow::Borrowed(bytes), None)
    };
    files.take(most_memory(&json))?;
    // The copy of the binary chunk.
    files.take(bin.as_ref().map_or(0, |bin| bin.len() as u64))?;
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&json);
    let mut root = read_root(json, files)?;
    check(&mut root)?;
    Ok(Gltf { document: Document::from_json_without_validation(root), blob: bin.map(Cow::into_owned) })
}

/// Reads the JSON of a document. The gltf crate requires a node of each channel of an animation, unlike glTF: other
/// channels, such as those of KHR_animation_pointer, are left out.
fn read_root(json: &[u8], files: &mut Files<'_>) -> Result<Root, AssetError> {
    let error = match deserialize::from_slice(json) {
        Ok(root) => return Ok(root),
        Err(error) => error,
    };
    // Many extensions and other versions make a document invalid: those are the better message.
    check_fields(json)?;
    // The values that are changed, and the document once more.
    files.take(most_memory(json))?;
    let changed = || {
        let mut root: Value = deserialize::from_slice(json).ok()?;
        for animation in root.get_mut("animations")?.as_array_mut()? {
            let is_of_node = |channel: &Value| channel.get("target").is_none_or(|target| target.get("node").is_some());
            animation.get_mut("channels")?.as_array_mut()?.retain(is_of_node);
        }
        deserialize::from_value(root).ok()
    };
    changed().ok_or_else(|| document_error(&error.to_string()))
}

/// A bound on the memory that parsing takes.
fn most_memory(json: &[u8]) -> u64 {
    let (mut objects, mut values) = (0, 1);
    for byte in json {
        objects += u64::from(*byte == b'{');
        values += u64::from(matches!(byte, b',' | b'['));
    }
    // Names are copied, and so are extras.
    objects * OBJECT_BYTES + values * VALUE_BYTES + 2 * json.len() as u64
}

/// Checks the version and the required extensions of a document, which may be invalid, as far as they can be
/// read.
fn check_fields(json: &[u8]) -> Result<(), AssetError> {
    let fields: BTreeMap<String, Extras> = deserialize::from_slice(json).unwrap_or_default();
    let field = |name: &str| fields.get(name).and_then(|field| Some(field.as_ref()?.get()));
    let asset: Option<Asset> = field("asset").and_then(|text| deserialize::from_str(text).ok());
    asset.map_or(Ok(()), |asset| check_version(&asset))?;
    let required: Option<Vec<String>> = field("extensionsRequired").and_then(|text| deserialize::from_str(text).ok());
    required.map_or(Ok(()), |required| check_extensions(&required))
}

//! Loads files with their buffers.

use std::path::{Path, PathBuf};

use ::gltf::buffer::Source;
use ::gltf::image::Source as ImageSource;
use ::gltf::{Document, Gltf};

use super::files::Files;
use super::options::GltfOptions;
use super::parse::parse_within;
use crate::error::{AssetError, invalid};

/// A document and its buffers.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct GltfFile {
    /// The validated document.
    pub document: Document,
    /// The contents of its buffers, by buffer index. Each has the length that the document states.
    pub buffers: Vec<Vec<u8>>,
    /// The folder in which its images and its profiles lie, if they are files.
    pub folder: Option<PathBuf>,
}

impl GltfFile {
    /// A document that [`parse`](super::parse) accepted, with buffers that were read in another way.
    pub fn new(document: Document, buffers: Vec<Vec<u8>>) -> Self {
        Self { document, buffers, folder: None }
    }
}

/// Loads a .gltf or .glb file with its buffers, which may be files in the same folder and below. This is the way to
/// load files of unknown origin.
///
/// No bytes make this function panic, recurse deeply or run for long. Its memory is limited by
/// [`GltfOptions::max_bytes`]. The [`Document`] can be read without a panic, except through the gltf
/// crate's readers of accessors: [`accessor_values`](super::accessor_values) and
/// [`primitive_attribute`](super::primitive_attribute) take their place. The graph of nodes is
/// checked later, by [`scene_nodes`](super::scene_nodes).
///
/// Buffers are the binary chunk of a .glb, base64 in data URIs, or regular files. The URI of a file
/// is a relative path without `..`, so that it stays in the folder of the document. A link in that
/// folder is followed. Images and profiles are read later, in the same way: images by [`read_image`], profiles by
/// [`load_lights`](super::load_lights).
///
/// # Errors
/// Those of [`parse`](super::parse), which come first, then [`AssetError::Invalid`] for a buffer that is missing, is
/// shorter than stated or has another URI; [`AssetError::Read`]; [`AssetError::Limit`].
///
/// # Cost
/// Linear in the bytes of the file and of its buffers.
pub fn load(path: impl AsRef<Path>, options: &GltfOptions) -> Result<GltfFile, AssetError> {
    let path = path.as_ref();
    let mut files = Files::new(path.parent(), options);
    let bytes = files.read(path, u64::MAX)?;
    let folder = path.parent().map(Path::to_owned);
    Ok(GltfFile { folder, ..with_buffers(&bytes, &mut files)? })
}

/// Loads the bytes of a .gltf or .glb file, of which the buffers must be part. Otherwise as [`load`].
///
/// # Errors
/// As for [`load`].
///
/// ```
/// use girandole_assets::AssetError;
/// use girandole_assets::girandole::LightWorld;
/// use girandole_assets::gltf::{GltfOptions, load_bytes, load_lights};
///
/// let document = br#"{
///     "asset": { "version": "2.0" },
///     "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 800 }] } },
///     "nodes": [{ "extensions": { "KHR_lights_punctual": { "light": 0 } } }]
/// }"#;
/// let options = GltfOptions::default();
/// let file = load_bytes(document, &options)?;
/// let mut world = LightWorld::new();
/// let lights = load_lights(&mut world, &file, &[], &options)?;
/// assert_eq!((lights.nodes.len(), world.light_count()), (1, 1));
///
/// let damaged = load_bytes(&document[..100], &options);
/// assert!(matches!(damaged, Err(AssetError::Invalid { .. })));
/// # Ok::<(), AssetError>(())
/// ```
pub fn load_bytes(bytes: &[u8], options: &GltfOptions) -> Result<GltfFile, AssetError> {
    with_buffers(bytes, &mut Files::new(None, options))
}

/// Parses a file and reads its buffers.
fn with_buffers(bytes: &[u8], files: &mut Files<'_>) -> Result<GltfFile, AssetError> {
    let Gltf { document, mut blob } = parse_within(bytes, files)?;
    let mut buffers = Vec::with_capacity(document.buffers().len());
    for buffer in document.buffers() {
        let (owner, stated) = (format!("buffer {}", buffer.index()), buffer.length());
        let mut data = match buffer.source() {
            Source::Bin => blob.take().ok_or_else(|| invalid(format!("{owner}: its binary chunk is missing")))?,
            Source::Uri(uri) => files.at_uri(&owner, uri, stated as u64)?,
        };
        if data.len() < stated {
            return Err(invalid(format!("{owner} has {} bytes; the document states {stated}", data.len())));
        }
        data.truncate(stated);
        buffers.push(data);
    }
    Ok(GltfFile::new(document, buffers))
}

/// The bytes of an image as the file stores them, such as those of a PNG file. They are not decoded.
///
/// An image is a data URI, a view of a buffer, or a file in [`GltfFile::folder`], of which the URI is a relative path
/// without `..`.
///
/// # Errors
/// [`AssetError::Invalid`] if there is no such image, its URI is refused, or its view reaches beyond
/// its buffer; [`AssetError::Read`]; [`AssetError::Limit`] if the image alone takes more than
/// [`GltfOptions::max_bytes`].
pub fn read_image(file: &GltfFile, image: usize, options: &GltfOptions) -> Result<Vec<u8>, AssetError> {
    let (owner, mut files) = (format!("image {image}"), Files::new(file.folder.as_deref(), options));
    let found = file.document.images().nth(image);
    match found.ok_or_else(|| invalid(format!("{owner}: the document has no such image")))?.source() {
        ImageSource::View { view, .. } => files.in_view(&owner, &view, &file.buffers),
        ImageSource::Uri { uri, .. } => files.at_uri(&owner, uri, u64::MAX),
    }
}

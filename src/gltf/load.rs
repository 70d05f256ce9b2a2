//! Loads files with their buffers.

use std::path::{Path, PathBuf};

use ::gltf::buffer::Source;
use ::gltf::{Buffer, Document, Gltf};

use super::budget::Budget;
use super::check::LIGHTS_IES;
use super::error::{GltfError, shortened};
use super::files::{file_length, read};
use super::options::GltfOptions;
use super::parse::parse_within;
use super::profiles::add_files;
use super::uri::{Location, decode_base64};

/// What [`load`] loads: the path of a file, or its bytes. Both convert to this.
#[derive(Clone, Copy, Debug)]
pub enum GltfSource<'a> {
    /// The path of a .gltf or .glb file. Its buffers may be files in the same folder and below.
    Path(&'a Path),
    /// The bytes of a .gltf or .glb file. Its buffers must be part of the file.
    Bytes(&'a [u8]),
}

impl<'a> From<&'a Path> for GltfSource<'a> {
    fn from(path: &'a Path) -> Self {
        Self::Path(path)
    }
}

impl<'a> From<&'a PathBuf> for GltfSource<'a> {
    fn from(path: &'a PathBuf) -> Self {
        Self::Path(path)
    }
}

impl<'a> From<&'a str> for GltfSource<'a> {
    /// A path, not the text of a document.
    fn from(path: &'a str) -> Self {
        Self::Path(Path::new(path))
    }
}

impl<'a> From<&'a [u8]> for GltfSource<'a> {
    fn from(bytes: &'a [u8]) -> Self {
        Self::Bytes(bytes)
    }
}

impl<'a> From<&'a Vec<u8>> for GltfSource<'a> {
    fn from(bytes: &'a Vec<u8>) -> Self {
        Self::Bytes(bytes)
    }
}

impl<'a, const N: usize> From<&'a [u8; N]> for GltfSource<'a> {
    fn from(bytes: &'a [u8; N]) -> Self {
        Self::Bytes(bytes)
    }
}

/// A document and its buffers.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct GltfFile {
    /// The validated document.
    pub document: Document,
    /// The contents of its buffers, by buffer index. Each has the length that the document states.
    pub buffers: Vec<Vec<u8>>,
}

/// Loads a .gltf or .glb file with its buffers, from a path or from bytes. This is the way to load
/// files of unknown origin.
///
/// No bytes make this function panic, recurse deeply or run for long. Its memory is limited by
/// [`GltfOptions::max_bytes`]. The [`Document`] can be read without a panic, except through the gltf
/// crate's readers of accessors: [`accessor_values`](super::accessor_values) and
/// [`primitive_triangles`](super::primitive_triangles) take their place. The graph of nodes is
/// checked later, by [`scene_nodes`](super::scene_nodes).
///
/// Buffers are the binary chunk of a .glb, base64 in data URIs, or regular files. The URI of a file
/// is a relative path without `..`, so that it stays in the folder of the document. A link in that
/// folder is followed. Images are not read: [`read_image`](super::read_image) reads them. Profiles of
/// EXT_lights_ies that are files are read too; in the document they are data URIs then.
///
/// # Errors
/// Those of [`parse`](super::parse), which come first, then [`GltfError::Uri`],
/// [`GltfError::NoBinaryChunk`], [`GltfError::BufferLength`], [`GltfError::Profile`], [`GltfError::Read`]
/// and [`GltfError::TooManyBytes`].
///
/// # Cost
/// Linear in the bytes of the file and of its buffers.
///
/// ```
/// use girandole::LightWorld;
/// use girandole::gltf::{self, GltfError, GltfOptions};
///
/// let document = br#"{
///     "asset": { "version": "2.0" },
///     "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 800 }] } },
///     "nodes": [{ "extensions": { "KHR_lights_punctual": { "light": 0 } } }]
/// }"#;
/// let options = GltfOptions::default();
/// let file = gltf::load(document, &options)?; // or gltf::load("scene.glb", &options)?
/// let mut world = LightWorld::new();
/// let lights = gltf::load_lights(&mut world, &file.document, &file.buffers, &options)?;
/// assert_eq!((lights.nodes.len(), world.light_count()), (1, 1));
///
/// let damaged = gltf::load(&document[..100], &options);
/// assert!(matches!(damaged, Err(GltfError::Document { .. })));
/// # Ok::<(), GltfError>(())
/// ```
pub fn load<'a>(source: impl Into<GltfSource<'a>>, options: &GltfOptions) -> Result<GltfFile, GltfError> {
    let mut budget = Budget::new(options.max_bytes);
    match source.into() {
        GltfSource::Bytes(bytes) => with_buffers(bytes, None, options, &mut budget),
        GltfSource::Path(path) => {
            let length = file_length(path)?;
            let bytes = read(path, length, &mut budget)?;
            with_buffers(&bytes, path.parent(), options, &mut budget)
        }
    }
}

/// Parses a file and reads its buffers, from files in `folder` too if there is one.
fn with_buffers(
    bytes: &[u8],
    folder: Option<&Path>,
    options: &GltfOptions,
    budget: &mut Budget,
) -> Result<GltfFile, GltfError> {
    let Gltf { mut document, mut blob } = parse_within(bytes, budget)?;
    if let Some(folder) = folder.filter(|_| options.punctual)
        && document.extension_value(LIGHTS_IES).is_some()
    {
        let mut root = document.into_json();
        add_files(&mut root, folder, budget)?;
        document = Document::from_json_without_validation(root);
    }
    let mut buffers = Vec::with_capacity(document.buffers().len());
    for buffer in document.buffers() {
        let mut data = match buffer.source() {
            Source::Bin => blob.take().ok_or(GltfError::NoBinaryChunk { buffer: buffer.index() })?,
            Source::Uri(uri) => contents(&buffer, uri, folder, budget)?,
        };
        check_length(&buffer, data.len() as u64)?;
        data.truncate(buffer.length());
        buffers.push(data);
    }
    Ok(GltfFile { document, buffers })
}

/// The bytes that the URI of a buffer refers to: at least as many as the document states, or the
/// buffer is too short.
fn contents(buffer: &Buffer<'_>, uri: &str, folder: Option<&Path>, budget: &mut Budget) -> Result<Vec<u8>, GltfError> {
    let refused = |what| GltfError::Uri { buffer: buffer.index(), uri: shortened(uri), what };
    match Location::of(uri).map_err(refused)? {
        Location::Inline(text) => {
            budget.take(text.len() as u64)?;
            decode_base64(text).map_err(refused)
        }
        Location::File(path) => {
            let unknown = "is that of a file, and the folder of the document is unknown";
            let path = folder.ok_or_else(|| refused(unknown))?.join(path);
            check_length(buffer, file_length(&path)?)?;
            read(&path, buffer.length() as u64, budget)
        }
    }
}

fn check_length(buffer: &Buffer<'_>, length: u64) -> Result<(), GltfError> {
    let stated = buffer.length() as u64;
    if length >= stated { Ok(()) } else { Err(GltfError::BufferLength { buffer: buffer.index(), length, stated }) }
}

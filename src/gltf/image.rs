//! The encoded bytes of images.

use std::path::Path;

use ::gltf::image::Source;

use super::budget::Budget;
use super::error::{GltfError, shortened};
use super::files::{file_length, read};
use super::load::GltfFile;
use super::options::GltfOptions;
use super::read::view_bytes;
use super::uri::{Location, decode_base64};

/// The bytes of an image as the file stores them, such as those of a PNG file. They are not decoded.
///
/// An image is a data URI, a view of a buffer, or a file in `folder`, which is the folder of the
/// document. As for buffers, the URI of a file is a relative path without `..`.
///
/// # Errors
/// [`GltfError::Image`] if there is no such image, its URI is refused, or its view reaches beyond
/// its buffer; [`GltfError::Read`]; [`GltfError::TooManyBytes`] if the image alone takes more than
/// [`GltfOptions::max_bytes`].
pub fn read_image(
    file: &GltfFile,
    image: usize,
    folder: Option<&Path>,
    options: &GltfOptions,
) -> Result<Vec<u8>, GltfError> {
    let refused = |message: String| GltfError::Image { image, message };
    let mut budget = Budget::new(options.max_bytes);
    let Some(found) = file.document.images().nth(image) else {
        return Err(refused("the document has no such image".into()));
    };
    let uri = match found.source() {
        Source::View { view, .. } => {
            let bytes =
                view_bytes(&view, &file.buffers).ok_or_else(|| refused("its view is beyond its buffer".into()))?;
            budget.take(bytes.len() as u64)?;
            return Ok(bytes.to_vec());
        }
        Source::Uri { uri, .. } => uri,
    };
    let refused_uri = |what: &str| refused(format!("its URI {what}: {}", shortened(uri)));
    match Location::of(uri).map_err(refused_uri)? {
        Location::Inline(text) => {
            budget.take(text.len() as u64)?;
            decode_base64(text).map_err(refused_uri)
        }
        Location::File(path) => {
            let unknown = "is that of a file, and the folder of the document is unknown";
            let path = folder.ok_or_else(|| refused_uri(unknown))?.join(path);
            read(&path, file_length(&path)?, &mut budget)
        }
    }
}

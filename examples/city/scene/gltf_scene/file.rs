//! Reads .glb and .gltf files with all of their buffers.

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};
use std::fs;
use std::path::{Path, PathBuf};

use girandole::gltf::gltf::buffer::Source;
use girandole::gltf::gltf::{Document, Gltf};
use girandole::gltf::parse;

use super::SceneError;

/// Writers of data URIs may leave out the padding.
const LENIENT: GeneralPurposeConfig =
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);

/// A document and its buffers.
#[derive(Debug)]
pub struct GltfFile {
    /// The validated document.
    pub document: Document,
    /// The contents of each buffer, at least as long as the document states.
    pub buffers: Vec<Vec<u8>>,
}

/// Reads a file and the buffers that it refers to. An error is one line that begins with the path.
pub fn open(path: &Path) -> Result<GltfFile, SceneError> {
    let fail = |what: String| SceneError(format!("{}: {what}", path.display()));
    let bytes = fs::read(path).map_err(|error| fail(error.to_string()))?;
    let Gltf { document, mut blob } = parse(&bytes).map_err(|error| fail(error.to_string()))?;
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let data = match buffer.source() {
            Source::Bin => blob.take().ok_or_else(|| fail("its binary chunk is missing".into()))?,
            Source::Uri(uri) => {
                resolve(uri, path).map_err(|what| fail(format!("buffer {}: {what}", buffer.index())))?
            }
        };
        if data.len() < buffer.length() {
            let (index, has, needs) = (buffer.index(), data.len(), buffer.length());
            return Err(fail(format!("buffer {index} has {has} bytes; the document states {needs}")));
        }
        buffers.push(data);
    }
    Ok(GltfFile { document, buffers })
}

/// The bytes that a URI refers to: those of a data URI, or of a file in the folder of the document.
fn resolve(uri: &str, document: &Path) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let base64 = GeneralPurpose::new(&STANDARD, LENIENT);
        let (_, text) = data.split_once(";base64,").ok_or("its data URI is not base64")?;
        return base64.decode(text).map_err(|error| format!("its data URI is not valid base64: {error}"));
    }
    if uri.contains("://") || Path::new(uri).is_absolute() {
        return Err(format!("{uri} is not a relative path"));
    }
    let name = decode_percent(uri).ok_or_else(|| format!("{uri} is not a valid path"))?;
    let file: PathBuf = document.parent().unwrap_or(Path::new("")).join(name);
    fs::read(&file).map_err(|error| format!("{}: {error}", file.display()))
}

fn decode_percent(text: &str) -> Option<String> {
    let mut bytes = text.bytes();
    let mut decoded = Vec::with_capacity(text.len());
    while let Some(byte) = bytes.next() {
        decoded.push(match byte {
            b'%' => {
                let digit = |byte: u8| (byte as char).to_digit(16);
                let (high, low) = (digit(bytes.next()?)?, digit(bytes.next()?)?);
                (high * 16 + low) as u8
            }
            other => other,
        });
    }
    String::from_utf8(decoded).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_and_percent_encoding_are_decoded() {
        let data =
            |text: &str| resolve(&format!("data:application/octet-stream;base64,{text}"), Path::new("scene.gltf"));
        assert_eq!(data("aGVsbG8gd29ybGQ=").as_deref(), Ok(b"hello world".as_slice()));
        assert_eq!(data("aGk").as_deref(), Ok(b"hi".as_slice()));
        assert!(data("a*").is_err());
        assert_eq!(decode_percent("my%20scene.bin").as_deref(), Some("my scene.bin"));
        assert_eq!(decode_percent("bad%2"), None);
    }
}

//! Where the bytes of buffers, images and profiles lie: in data URIs, in views of buffers, and in files in the folder
//! of the document. They are read within a limit of memory.

use std::fmt::Display;
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

use ::gltf::buffer::View;
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};

use super::options::GltfOptions;
use crate::error::{AssetError, invalid, shortened};

/// Writers of data URIs may leave out the padding.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// The folder of a document, and what is left of [`GltfOptions::max_bytes`].
pub(super) struct Files<'a> {
    /// `None` if it is unknown.
    folder: Option<&'a Path>,
    limit: u64,
    taken: u64,
}

impl<'a> Files<'a> {
    pub fn new(folder: Option<&'a Path>, options: &GltfOptions) -> Self {
        Self { folder, limit: options.max_bytes, taken: 0 }
    }

    /// Takes a number of bytes, before they are allocated.
    pub fn take(&mut self, bytes: u64) -> Result<(), AssetError> {
        self.taken = self.taken.saturating_add(bytes);
        if self.taken <= self.limit {
            return Ok(());
        }
        Err(AssetError::Limit { option: "max_bytes", needed: self.taken, limit: self.limit })
    }

    /// The first `most` bytes of a regular file, or all if there are fewer. Other files may have no end, or wait for a
    /// writer when they are opened.
    pub fn read(&mut self, path: &Path, most: u64) -> Result<Vec<u8>, AssetError> {
        let refused = |what: &dyn Display| AssetError::Read { path: path.to_owned(), message: what.to_string() };
        let metadata = fs::metadata(path).map_err(|error| refused(&error))?;
        if !metadata.is_file() {
            return Err(refused(&"it is not a regular file"));
        }
        let length = metadata.len().min(most);
        self.take(length)?;
        let mut bytes = Vec::new();
        if !usize::try_from(length).is_ok_and(|length| bytes.try_reserve_exact(length).is_ok()) {
            return Err(refused(&"there is not enough memory"));
        }
        let file = File::open(path).map_err(|error| refused(&error))?;
        file.take(length).read_to_end(&mut bytes).map_err(|error| refused(&error))?;
        Ok(bytes)
    }

    /// The bytes that a URI refers to, of a file `most` at most. `owner` has the URI, and errors name it.
    pub fn at_uri(&mut self, owner: &str, uri: &str, most: u64) -> Result<Vec<u8>, AssetError> {
        let refused = |what: &str| invalid(format!("{owner}: its URI {what}: {}", shortened(uri)));
        match Location::of(uri).map_err(refused)? {
            Location::Inline(text) => {
                self.take(text.len() as u64)?;
                decode_base64(text).map_err(refused)
            }
            Location::File(path) => {
                let unknown = "is that of a file, and the folder of the document is unknown";
                let folder = self.folder.ok_or_else(|| refused(unknown))?;
                self.read(&folder.join(path), most)
            }
        }
    }

    /// A copy of the bytes of a view of a buffer.
    pub fn in_view(&mut self, owner: &str, view: &View<'_>, buffers: &[Vec<u8>]) -> Result<Vec<u8>, AssetError> {
        let end = view.offset().checked_add(view.length());
        let bytes = buffers.get(view.buffer().index()).and_then(|buffer| buffer.get(view.offset()..end?));
        let bytes = bytes.ok_or_else(|| invalid(format!("{owner}: its view is beyond its buffer")))?;
        self.take(bytes.len() as u64)?;
        Ok(bytes.to_vec())
    }
}

/// What a URI refers to.
#[derive(Debug, PartialEq)]
enum Location<'a> {
    /// The bytes of base64 in the URI.
    Inline(&'a str),
    /// In a file, by its path from the folder of the document. The path does not leave that folder,
    /// on Windows either.
    File(PathBuf),
}

impl<'a> Location<'a> {
    /// An error completes the sentence "The URI ...".
    fn of(uri: &'a str) -> Result<Self, &'static str> {
        const SCHEME: &str = "data:";
        let scheme = uri.get(..SCHEME.len()).filter(|scheme| scheme.eq_ignore_ascii_case(SCHEME));
        if let Some(scheme) = scheme {
            let (_, text) = uri[scheme.len()..].split_once(";base64,").ok_or("is not base64")?;
            return Ok(Self::Inline(text));
        }
        let path = decode_percent(uri).ok_or("is not percent-encoded UTF-8")?;
        // The decoded path is checked: %2e%2e is two points.
        let faults = [
            (path.is_empty() || path.chars().any(char::is_control), "is not a path"),
            (path.contains(':'), "has a scheme or a drive; only relative paths and data URIs are read"),
            (path.starts_with('/'), "is an absolute path; only relative ones are read"),
            (path.contains('\\'), "has a backslash; folders are separated by /"),
            (path.split('/').any(|part| part == ".."), "has .. in it and may lead out of the folder of the document"),
        ];
        if let Some((_, what)) = faults.into_iter().find(|(is_faulty, _)| *is_faulty) {
            return Err(what);
        }
        Ok(Self::File(path.split('/').collect()))
    }
}

/// The bytes of base64 text.
fn decode_base64(text: &str) -> Result<Vec<u8>, &'static str> {
    BASE64.decode(text).map_err(|_| "is not valid base64")
}

/// The text with each %xx replaced by its byte; `None` if digits are missing or the result is not
/// UTF-8.
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
    fn base64_is_decoded_with_padding_and_without() {
        let data = |uri: &str| match Location::of(uri) {
            Ok(Location::Inline(text)) => decode_base64(text),
            Ok(Location::File(path)) => panic!("{path:?}"),
            Err(what) => Err(what),
        };
        assert_eq!(data("data:application/octet-stream;base64,aGVsbG8gd29ybGQ=").as_deref(), Ok(&b"hello world"[..]));
        assert_eq!(data("DATA:;base64,aGk").as_deref(), Ok(&b"hi"[..]));
        assert_eq!(data("data:;base64,"), Ok(Vec::new()));
        assert_eq!(data("data:;base64,a*"), Err("is not valid base64"));
        assert_eq!(data("data:;base64,aGk\u{e9}"), Err("is not valid base64"));
        for other in ["data:", "data:,hi", "data:;base64"] {
            assert_eq!(data(other), Err("is not base64"), "{other}");
        }
    }

    #[test]
    fn files_lie_in_the_folder_of_the_document() {
        let file = |uri: &str| match Location::of(uri) {
            Ok(Location::File(path)) => path.to_str().map(|path| path.replace('\\', "/")),
            _ => None,
        };
        let inside = [
            ("scene.bin", "scene.bin"),
            ("my%20scene.bin", "my scene.bin"),
            ("a/./b.bin", "a/./b.bin"),
            ("a//b.bin", "a/b.bin"),
            ("..a/b..", "..a/b.."),
            ("%c3%a9\u{e9}.bin", "\u{e9}\u{e9}.bin"),
            ("a%252e.bin", "a%2e.bin"),
            ("\u{e9}", "\u{e9}"),
        ];
        for (uri, path) in inside {
            assert_eq!(file(uri).as_deref(), Some(path), "{uri}");
        }
        let outside = [
            "",
            "/etc/passwd",
            "%2fetc/passwd",
            "//host/share",
            "..",
            "../a.bin",
            "a/../../b.bin",
            "a/..",
            "%2e%2e/a.bin",
            "%2E./a.bin",
            "..%2fa.bin",
            "..\\a.bin",
            "%5c%5chost%5cshare",
            "C:/a.bin",
            "C%3a\\a.bin",
            "a.bin:stream",
            "file:///etc/passwd",
            "http://host/a.bin",
            "a%00.bin",
            "a\n.bin",
            "bad%2",
            "bad%",
            "bad%g0",
            "%ff.bin",
            "%\u{e9}",
        ];
        for uri in outside {
            assert!(Location::of(uri).is_err(), "{uri}");
        }
    }
}

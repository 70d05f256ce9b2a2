//! The URIs of buffers: data URIs, and files in the folder of the document.

use std::path::PathBuf;

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};

/// Writers of data URIs may leave out the padding.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Where the bytes of a buffer are.
#[derive(Debug, PartialEq)]
pub(super) enum Location<'a> {
    /// In the URI, as base64.
    Inline(&'a str),
    /// In a file, by its path from the folder of the document. The path does not leave that folder,
    /// on Windows either.
    File(PathBuf),
}

impl<'a> Location<'a> {
    /// An error completes the sentence "The URI ...".
    pub fn of(uri: &'a str) -> Result<Self, &'static str> {
        const SCHEME: &str = "data:";
        let scheme = uri.get(..SCHEME.len()).filter(|scheme| scheme.eq_ignore_ascii_case(SCHEME));
        if let Some(scheme) = scheme {
            let (_, text) = uri[scheme.len()..].split_once(";base64,").ok_or("is not base64")?;
            return Ok(Self::Inline(text));
        }
        let path = decode_percent(uri).ok_or("is not percent-encoded UTF-8")?;
        // The decoded path is checked: %2e%2e is two points.
        if path.is_empty() || path.chars().any(char::is_control) {
            return Err("is not a path");
        }
        if path.contains(':') {
            return Err("has a scheme or a drive; only relative paths and data URIs are read");
        }
        if path.starts_with('/') {
            return Err("is an absolute path; only relative ones are read");
        }
        if path.contains('\\') {
            return Err("has a backslash; folders are separated by /");
        }
        if path.split('/').any(|part| part == "..") {
            return Err("has .. in it and may lead out of the folder of the document");
        }
        Ok(Self::File(path.split('/').collect()))
    }
}

/// A data URI of some bytes.
pub(super) fn encode_base64(bytes: &[u8]) -> String {
    format!("data:application/octet-stream;base64,{}", BASE64.encode(bytes))
}

/// The bytes of base64 text.
pub(super) fn decode_base64(text: &str) -> Result<Vec<u8>, &'static str> {
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

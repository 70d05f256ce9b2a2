//! Why a file or an image was refused.

use std::fmt::Display;
use std::path::PathBuf;

use girandole::WorldError;

/// Characters of a file's text in an error.
#[cfg(feature = "gltf")]
const MAX_SHOWN: usize = 200;

/// Why a file, an image or the lights of one were refused. A world is then as it was before the call.
///
/// Messages are one line each. They name parts of a file by their index or their line, and say what was given and what
/// is allowed. Text from a file is shortened, and its control characters are escaped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AssetError {
    /// The bytes, the pixels or the numbers are not valid.
    #[error("{message}")]
    Invalid {
        /// The first fault.
        message: String,
    },
    /// The world refused a tree, an instance or a directional light.
    ///
    /// The usual cause is a node that lies too far from the origin, or whose scale is too large or
    /// too small. A scale of zero is not an error: it hides the node.
    #[error("node {node}: {source}")]
    World {
        /// Index of the node. Of a tree that several nodes share, the first.
        node: usize,
        /// Why the world refused it.
        source: WorldError,
    },
    /// The document requires extensions that are not supported.
    #[error("the file requires extensions that are not supported: {}", names.join(", "))]
    Extensions {
        /// Their names, each once, at most 16.
        names: Vec<String>,
    },
    /// A file could not be read.
    #[error("{}: {message}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why not.
        message: String,
    },
    /// The file needs more than a limit of `gltf::GltfOptions`.
    #[error("{option} is {limit}; the file needs {needed} or more")]
    Limit {
        /// The name of the field.
        option: &'static str,
        /// What the file needs, up to the point at which loading ended.
        needed: u64,
        /// The limit.
        limit: u64,
    },
}

impl AssetError {
    /// The stable code, see [`error`](girandole::error). An error that wraps a [`WorldError`] has a code of its own; the
    /// `source` field has the inner code.
    pub fn code(&self) -> u32 {
        match self {
            Self::Invalid { .. } => 700,
            Self::World { .. } => 709,
            Self::Extensions { .. } => 712,
            Self::Read { .. } => 716,
            Self::Limit { .. } => 717,
        }
    }
}

/// An error with a message of one line, which holds no text from a file but shortened one.
pub(crate) fn invalid(message: impl Display) -> AssetError {
    AssetError::Invalid { message: message.to_string() }
}

/// The beginning of a text, on one line and without control characters.
#[cfg(feature = "gltf")]
pub(crate) fn shortened(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().take(MAX_SHOWN + 1).collect();
    let line = words.join(" ");
    let mut chars = line.chars();
    let mut shown = String::new();
    for c in chars.by_ref().take(MAX_SHOWN) {
        if c.is_control() { shown.extend(c.escape_default()) } else { shown.push(c) }
    }
    if chars.next().is_some() {
        shown.push_str("...");
    }
    shown
}

#[cfg(all(test, feature = "gltf"))]
mod tests {
    use super::*;

    #[test]
    fn text_of_a_file_is_shortened_to_one_printable_line() {
        assert_eq!(shortened("a\n\n  b\t"), "a b");
        assert_eq!(shortened("red\u{1b}[31m \0"), "red\\u{1b}[31m \\u{0}");
        let whole = "\u{e9}".repeat(MAX_SHOWN);
        assert_eq!(shortened(&whole), whole);
        assert_eq!(shortened(&(whole.clone() + "a")), whole + "...");
        assert_eq!(shortened(&"a ".repeat(1000)), "a ".repeat(MAX_SHOWN / 2) + "...");
        assert_eq!(shortened(""), "");
    }
}

//! Why the bytes of a baked tree were refused.

use crate::error::LightError;
use crate::tree::check::CheckError;

/// Why [`LightTree::from_baked`](crate::LightTree::from_baked) refused some bytes. Nothing was
/// loaded. Codes 1100 to 1107, or the code of the [`LightError`] or [`CheckError`] inside.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BakeError {
    /// The bytes do not start as a baked tree does.
    #[error("not a baked tree: the first bytes are not those of the format")]
    NotBaked,
    /// The numbers were written with their most significant bytes first. The format stores the
    /// least significant byte first on every machine, so another program has written the file or
    /// changed it.
    #[error("the bytes of each number are in reverse order")]
    ByteOrder,
    /// The file has a version of the format that this version of the library does not read.
    #[error("version {given} of the format; this library reads version {supported}: bake the tree again")]
    Version {
        /// The version of the file.
        given: u32,
        /// The version that is read.
        supported: u32,
    },
    /// The file is shorter or longer than the numbers of its records require.
    #[error("{given} bytes; the header requires {expected}")]
    Length {
        /// The given number of bytes.
        given: u64,
        /// The number of bytes that follows from the header; the size of the header if not even
        /// that is complete.
        expected: u64,
    },
    /// The file states more of something than a tree can have.
    #[error("{given} {what}; the limit is {limit}")]
    TooMany {
        /// What is counted, in the plural.
        what: &'static str,
        /// The number in the file.
        given: u32,
        /// The greatest number allowed.
        limit: u32,
    },
    /// The content differs from what was written.
    #[error("the checksum is {computed:#010x}, but the file states {stored:#010x}: the file is damaged")]
    Checksum {
        /// The checksum that the file states.
        stored: u32,
        /// The checksum of its content.
        computed: u32,
    },
    /// The checksum is right, but a record has a value that is never written.
    #[error("{what} of record {index} has a value that is never written")]
    Record {
        /// What the record describes.
        what: &'static str,
        /// The index of the record among those of its kind. 0 for the header.
        index: usize,
    },
    /// The checksum is right, but a light is invalid.
    #[error("light {index}: {source}")]
    Light {
        /// The index of the light.
        index: usize,
        /// What is wrong with the light.
        source: LightError,
    },
    /// A light has a [`Profile`](crate::Profile) that was not made in this process. Files do not hold
    /// profiles, which many trees share: read them before the trees.
    #[error("light {index} has a profile that was not made before: its number is {id:#018x}")]
    Profile {
        /// The index of the light.
        index: usize,
        /// The [number](crate::Profile::id) of the profile.
        id: u64,
    },
    /// The checksum is right, but the nodes are not those of a tree over the lights.
    #[error("{0}")]
    Tree(#[from] CheckError),
}

impl BakeError {
    /// The stable code, see [`error`](crate::error).
    pub fn code(&self) -> u32 {
        match self {
            Self::NotBaked => 1100,
            Self::ByteOrder => 1101,
            Self::Version { .. } => 1102,
            Self::Length { .. } => 1103,
            Self::TooMany { .. } => 1104,
            Self::Checksum { .. } => 1105,
            Self::Record { .. } => 1106,
            Self::Profile { .. } => 1107,
            Self::Light { source, .. } => source.code(),
            Self::Tree(error) => error.code(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_distinct_and_an_error_that_wraps_another_has_the_inner_code() {
        let own = [
            BakeError::NotBaked,
            BakeError::ByteOrder,
            BakeError::Version { given: 2, supported: 1 },
            BakeError::Length { given: 1, expected: 2 },
            BakeError::TooMany { what: "lights", given: 3, limit: 2 },
            BakeError::Checksum { stored: 1, computed: 2 },
            BakeError::Record { what: "the kind", index: 7 },
        ];
        assert_eq!(own.map(|error| error.code()), [1100, 1101, 1102, 1103, 1104, 1105, 1106]);
        let source = LightError::NotPositive { what: "range", value: 0.0 };
        assert_eq!(BakeError::Light { index: 7, source }.code(), source.code());
        let fault = CheckError { node: 1, slot: 2, what: "wrong" };
        assert_eq!(BakeError::from(fault.clone()).code(), fault.code());
        assert_eq!(BakeError::from(fault).to_string(), "node 1, slot 2: wrong");
    }
}

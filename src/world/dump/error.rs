//! Why a dump was refused.

use crate::error::WorldError;
use crate::tree::BakeError;

/// Why [`LightWorld::from_dump`](crate::LightWorld::from_dump) refused some bytes. Codes 1600 to 1604,
/// or the code of the error inside.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DumpError {
    /// The bytes do not start as a dump does.
    #[error("not a dump of a light world: the first bytes are not those of the format")]
    NotADump,
    /// The file has a version of the format that this version of the library does not read.
    #[error("version {given} of the format; this library reads version {supported}")]
    Version {
        /// The version of the file.
        given: u32,
        /// The version that is read.
        supported: u32,
    },
    /// The content differs from what was written.
    #[error("the checksum is {computed:#010x}, but the file states {stored:#010x}: the file is damaged or incomplete")]
    Checksum {
        /// The last four bytes of the file.
        stored: u32,
        /// The checksum of all others.
        computed: u32,
    },
    /// The checksum is right, but a record has a value that is never written.
    #[error("{what} {index} has a value that is never written")]
    Record {
        /// What the record describes.
        what: &'static str,
        /// Its index among those of its kind.
        index: usize,
    },
    /// The instances have too many parts together: openings, or particles of trees of
    /// [`TreeSource::GpuParticles`](crate::TreeSource::GpuParticles). Those of the first instance of each tree do not
    /// count.
    #[error(
        "instance {index}: more than {most} openings and particles, beside those of the first instance of each tree"
    )]
    Parts {
        /// The index of the instance that has one too many.
        index: usize,
        /// The greatest number.
        most: usize,
    },
    /// The checksum is right, but a tree was refused.
    #[error("tree {index}: {source}")]
    Tree {
        /// The index of the tree.
        index: usize,
        /// What is wrong with the tree.
        source: BakeError,
    },
    /// The checksum is right, but a world does not accept a value.
    #[error("{what} {index}: {source}")]
    World {
        /// What has the value.
        what: &'static str,
        /// Its index among those of its kind.
        index: usize,
        /// What is wrong with the value.
        source: WorldError,
    },
}

impl DumpError {
    /// The stable code, see [`error`](crate::error).
    pub fn code(&self) -> u32 {
        match self {
            Self::NotADump => 1600,
            Self::Version { .. } => 1601,
            Self::Checksum { .. } => 1602,
            Self::Record { .. } => 1603,
            Self::Parts { .. } => 1604,
            Self::Tree { source, .. } => source.code(),
            Self::World { source, .. } => source.code(),
        }
    }
}

//! What a glTF file can get wrong.

use crate::error::{LightError, WorldError};

/// Why lights could not be made from a glTF document. The world is as it was before the call.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GltfError {
    /// The document asks for a buffer that was not given.
    #[error("buffer {buffer} is missing: {given} buffers were given")]
    MissingBuffer {
        /// Its index in the file.
        buffer: usize,
        /// How many there are.
        given: usize,
    },
    /// An accessor's values lie outside its buffer view, or the view outside its buffer.
    #[error("accessor {accessor} reads bytes up to {end}, but its {what} has {length}")]
    OutOfBounds {
        /// Its index in the file.
        accessor: usize,
        /// "buffer view" or "buffer".
        what: &'static str,
        /// One past the last byte that it reads.
        end: u128,
        /// How many there are.
        length: u128,
    },
    /// Valid glTF, perhaps, but of a kind that is not read here.
    #[error("accessor {accessor}: {what}")]
    Accessor {
        /// Its index in the file.
        accessor: usize,
        /// What is not read, or not allowed.
        what: &'static str,
    },
    /// A triangle uses a vertex that does not exist.
    #[error("mesh {mesh}: vertex {vertex} of {count}")]
    NoSuchVertex {
        /// Its index in the file.
        mesh: usize,
        /// What the indices ask for.
        vertex: u32,
        /// How many positions there are.
        count: usize,
    },
    /// A primitive of triangles without positions.
    #[error("mesh {mesh}: a primitive has no positions")]
    NoPositions {
        /// Its index in the file.
        mesh: usize,
    },
    /// A node's transform is not finite, or has a rotation or direction without length.
    #[error("node {node}: its transform is not finite or has no direction")]
    Transform {
        /// Its index in the file.
        node: usize,
    },
    /// A node has two parents, or is its own ancestor.
    #[error("node {node} is reached twice: the nodes are not a tree")]
    NotATree {
        /// Its index in the file.
        node: usize,
    },
    /// An emissive triangle or a punctual light has a bad number.
    #[error("{what} {index}: {source}")]
    Light {
        /// "mesh" or "light".
        what: &'static str,
        /// Its index in the file.
        index: usize,
        /// What is wrong.
        source: LightError,
    },
    /// The world refused a tree or an instance, such as one whose node flattens space.
    #[error("node {node}: {source}")]
    LightWorld {
        /// Its index in the file.
        node: usize,
        /// What is wrong.
        source: WorldError,
    },
}

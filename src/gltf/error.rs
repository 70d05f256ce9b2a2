//! Errors in glTF documents and in how they are loaded.

use crate::error::{LightError, WorldError};

/// Why the lights of a glTF document could not be loaded. The world is as it was before the call.
///
/// Indices are those of the document's arrays. Codes 700 to 711.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GltfError {
    /// The bytes are not valid glTF.
    #[error("not a valid glTF file: {message}")]
    Document {
        /// The first fault, on one line.
        message: String,
    },
    /// An accessor reads from a buffer that the caller did not pass.
    #[error("buffer {buffer} is missing: {given} buffers were given")]
    MissingBuffer {
        /// Index of the buffer.
        buffer: usize,
        /// Number of buffers that were passed.
        given: usize,
    },
    /// An accessor's elements reach beyond its buffer view, or the view beyond its buffer.
    #[error("accessor {accessor} reads up to byte {end}, but its {what} has {length} bytes")]
    OutOfBounds {
        /// Index of the accessor.
        accessor: usize,
        /// What is too short: "buffer view" or "buffer".
        what: &'static str,
        /// One past the last byte that the accessor reads, counted from the start of `what`.
        end: u128,
        /// Bytes in `what`.
        length: u128,
    },
    /// An accessor has a form that is invalid here, or valid but not supported.
    #[error("accessor {accessor}: {what}")]
    Accessor {
        /// Index of the accessor.
        accessor: usize,
        /// What is invalid or not supported.
        what: &'static str,
    },
    /// A triangle refers to a vertex that does not exist.
    #[error("mesh {mesh}: a triangle uses vertex {vertex}, but there are {count} vertices")]
    NoSuchVertex {
        /// Index of the mesh.
        mesh: usize,
        /// The vertex that the triangle refers to.
        vertex: u32,
        /// Number of vertices in the primitive.
        count: usize,
    },
    /// A primitive of triangles has no `POSITION` attribute.
    #[error("mesh {mesh}: a primitive has no positions")]
    NoPositions {
        /// Index of the mesh.
        mesh: usize,
    },
    /// A node's transform is not finite, or leaves a rotation or a light's direction undefined.
    #[error("node {node}: its transform is not finite, or has no direction")]
    Transform {
        /// Index of the node.
        node: usize,
    },
    /// A node has two parents, or is its own ancestor.
    #[error("node {node} has two parents or is its own ancestor")]
    NotATree {
        /// Index of the node.
        node: usize,
    },
    /// An emissive triangle or a punctual light has an invalid value.
    #[error("{what} {index}: {source}")]
    Light {
        /// "mesh" or "light".
        what: &'static str,
        /// Index of the mesh or light.
        index: usize,
        /// What is invalid.
        source: LightError,
    },
    /// The world refused a tree, an instance or a directional light.
    ///
    /// The usual cause is a node whose scale is zero along one or two axes. A scale that is zero
    /// along all three is not an error: it hides the node.
    #[error("node {node}: {source}")]
    World {
        /// Index of the node. Of a tree that several nodes share, the first.
        node: usize,
        /// Why the world refused it.
        source: WorldError,
    },
    /// The document has more lights than
    /// [`GltfOptions::max_lights`](super::GltfOptions::max_lights).
    #[error("the document has {found} lights; max_lights is {limit}")]
    TooManyLights {
        /// Number of lights that loading would create. A tree that several nodes share counts once.
        found: u64,
        /// The limit.
        limit: usize,
    },
    /// [`GltfOptions::surface_scale`](super::GltfOptions::surface_scale) is negative or not finite.
    #[error("surface_scale is {value}; it must be finite and at least 0")]
    SurfaceScale {
        /// The value that was passed.
        value: f32,
    },
}

impl GltfError {
    /// The stable code, see [`error`](crate::error). An error that wraps a [`LightError`] or a
    /// [`WorldError`] has a code of its own; the `source` field has the inner code.
    pub fn code(&self) -> u32 {
        match self {
            Self::Document { .. } => 700,
            Self::MissingBuffer { .. } => 701,
            Self::OutOfBounds { .. } => 702,
            Self::Accessor { .. } => 703,
            Self::NoSuchVertex { .. } => 704,
            Self::NoPositions { .. } => 705,
            Self::Transform { .. } => 706,
            Self::NotATree { .. } => 707,
            Self::Light { .. } => 708,
            Self::World { .. } => 709,
            Self::TooManyLights { .. } => 710,
            Self::SurfaceScale { .. } => 711,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_stable() {
        let light = LightError::NotFinite { what: "range", value: f32::NAN };
        let source = WorldError::TooManyLights { given: 2, limit: 1 };
        let errors = [
            (700, GltfError::Document { message: "truncated".into() }),
            (701, GltfError::MissingBuffer { buffer: 0, given: 0 }),
            (702, GltfError::OutOfBounds { accessor: 0, what: "buffer", end: 2, length: 1 }),
            (703, GltfError::Accessor { accessor: 0, what: "sparse accessors are not supported" }),
            (704, GltfError::NoSuchVertex { mesh: 0, vertex: 3, count: 3 }),
            (705, GltfError::NoPositions { mesh: 0 }),
            (706, GltfError::Transform { node: 0 }),
            (707, GltfError::NotATree { node: 0 }),
            (708, GltfError::Light { what: "light", index: 0, source: light }),
            (709, GltfError::World { node: 0, source }),
            (710, GltfError::TooManyLights { found: 2, limit: 1 }),
            (711, GltfError::SurfaceScale { value: -1.0 }),
        ];
        for (code, error) in errors {
            assert_eq!(error.code(), code, "{error}");
        }
    }
}

//! Errors in glTF documents and in how they are loaded.

use std::path::PathBuf;

use crate::error::{LightError, WorldError};

/// Characters of a file's text in an error.
const MAX_SHOWN: usize = 200;

/// Why a glTF file or its lights could not be loaded. The world is as it was before the call.
///
/// Indices are those of the document's arrays. Text from the file is shortened, and its control
/// characters are escaped. Codes 700 to 721.
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
    /// The transform of a node or of an instance of its mesh is not finite, or its rotation has no
    /// length.
    #[error("node {node}: its transform is not finite, or its rotation has no length")]
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
    /// The usual cause is a node that lies too far from the origin, or whose scale is too large or
    /// too small. A scale of zero is not an error: it hides the node.
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
    /// The document requires extensions that are not supported.
    #[error("the file requires extensions that are not supported: {}", names.join(", "))]
    UnsupportedExtensions {
        /// Their names, each once, at most 16.
        names: Vec<String>,
    },
    /// The URI of a buffer is not one that is read: see [`load`](super::load).
    #[error("buffer {buffer}: its URI {what}: {uri}")]
    Uri {
        /// Index of the buffer.
        buffer: usize,
        /// The URI.
        uri: String,
        /// What is wrong with it; "its URI" is the subject.
        what: &'static str,
    },
    /// A buffer is stored in the binary chunk of a .glb, and there is none, or another buffer has
    /// it.
    #[error("buffer {buffer}: its binary chunk is missing")]
    NoBinaryChunk {
        /// Index of the buffer.
        buffer: usize,
    },
    /// A buffer has fewer bytes than the document states.
    #[error("buffer {buffer} has {length} bytes; the document states {stated}")]
    BufferLength {
        /// Index of the buffer.
        buffer: usize,
        /// Bytes that there are.
        length: u64,
        /// Bytes that the document states.
        stated: u64,
    },
    /// A file could not be read.
    #[error("{}: {message}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why not.
        message: String,
    },
    /// The file, its buffers and the parsed document need more memory than
    /// [`GltfOptions::max_bytes`](super::GltfOptions::max_bytes).
    #[error("loading needs {needed} bytes or more; max_bytes is {limit}")]
    TooManyBytes {
        /// Bytes needed up to the point at which loading ended, by estimate.
        needed: u64,
        /// The limit.
        limit: u64,
    },
    /// An image does not exist, cannot be read or has the wrong number of bytes, or the transform
    /// of its texture is not finite.
    #[error("image {image}: {message}")]
    Image {
        /// Index of the image.
        image: usize,
        /// What is wrong.
        message: String,
    },
    /// A profile of EXT_lights_ies does not exist, cannot be read or is refused.
    #[error("profile {profile}: {message}")]
    Profile {
        /// Index of the profile.
        profile: usize,
        /// What is wrong.
        message: String,
    },
    /// A light of EXT_lights_image_based does not exist, or is refused.
    #[error("image based light {light}: {message}")]
    ImageBasedLight {
        /// Index of the light.
        light: usize,
        /// What is wrong.
        message: String,
    },
    /// The document has more instances of emissive meshes and lights than
    /// [`GltfOptions::max_instances`](super::GltfOptions::max_instances).
    #[error("the document has {found} instances of lights; max_instances is {limit}")]
    TooManyInstances {
        /// Number of instances up to the point at which loading ended.
        found: u64,
        /// The limit.
        limit: usize,
    },
}

/// An error with a message of one line.
pub(super) fn document_error(message: &str) -> GltfError {
    GltfError::Document { message: shortened(message) }
}

/// The beginning of a text, on one line and without control characters.
pub(super) fn shortened(text: &str) -> String {
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
            Self::UnsupportedExtensions { .. } => 712,
            Self::Uri { .. } => 713,
            Self::NoBinaryChunk { .. } => 714,
            Self::BufferLength { .. } => 715,
            Self::Read { .. } => 716,
            Self::TooManyBytes { .. } => 717,
            Self::Image { .. } => 718,
            Self::TooManyInstances { .. } => 719,
            Self::Profile { .. } => 720,
            Self::ImageBasedLight { .. } => 721,
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
            (712, GltfError::UnsupportedExtensions { names: vec!["KHR_draco_mesh_compression".into()] }),
            (713, GltfError::Uri { buffer: 0, uri: "..".into(), what: "is not a path" }),
            (714, GltfError::NoBinaryChunk { buffer: 1 }),
            (715, GltfError::BufferLength { buffer: 0, length: 1, stated: 2 }),
            (716, GltfError::Read { path: "scene.glb".into(), message: "not found".into() }),
            (717, GltfError::TooManyBytes { needed: 2, limit: 1 }),
            (718, GltfError::Image { image: 0, message: "it is missing".into() }),
            (719, GltfError::TooManyInstances { found: 2, limit: 1 }),
            (720, GltfError::Profile { profile: 0, message: "it is missing".into() }),
            (721, GltfError::ImageBasedLight { light: 0, message: "it is missing".into() }),
        ];
        for (code, error) in errors {
            assert_eq!(error.code(), code, "{error}");
        }
    }

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

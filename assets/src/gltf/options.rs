//! Options for loading documents and their lights.

use girandole::Policy;

/// Which sides of emissive triangles emit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum EmissiveSides {
    /// Both sides where the material is `doubleSided`, otherwise the front, as glTF viewers show
    /// them.
    #[default]
    OfMaterial,
    /// Always the front only. Correct for closed meshes regardless of their material, and less
    /// noisy: a one-sided light is not sampled from behind.
    Front,
    /// Always both sides. Correct for thin sheets whose winding is unreliable.
    Both,
}

/// What to load from a document, and how; and the limits of [`load`](super::load) and
/// [`load_lights`](super::load_lights).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GltfOptions {
    /// Whether emissive triangles become lights. Default: true. A [factor](girandole::Appearance::factor) of their
    /// instances scales their emission.
    pub surfaces: bool,
    /// Which sides of emissive triangles emit. Default: [`EmissiveSides::OfMaterial`].
    pub sides: EmissiveSides,
    /// The noise of emissive textures within a light, at which primitives are no longer cut into parts:
    /// see [`Texture::split`](crate::texture::Texture::split). Default: 0.3.
    pub texture_noise: f32,
    /// The most lights that a document gets beyond its triangles, by cutting those whose emissive texture varies; a
    /// primitive gets at most 1,024 of them. 0 for one light of a triangle, which emits the average.
    /// Default: 2^16 (65,536).
    pub texture_parts: usize,
    /// Whether the lights of KHR_lights_punctual and EXT_lights_ies are loaded. Default: true.
    pub punctual: bool,
    /// The policy of every instance. Default: [`Policy::Budgeted`].
    pub policy: Policy,
    /// The most lights that one call creates; a document with more is refused with
    /// [`AssetError::Limit`](crate::AssetError::Limit) before memory is allocated for
    /// any of them. Textures are cut into no more parts than this leaves.
    ///
    /// A tree that several nodes share counts once. The limit exists because a small file can
    /// describe many lights: primitives with different materials can share one accessor. Default:
    /// 2^22 (4,194,304).
    pub max_lights: usize,
    /// The most instances that one call creates; a document with more is refused with
    /// [`AssetError::Limit`](crate::AssetError::Limit) before memory is allocated
    /// for those beyond the limit.
    ///
    /// The limit exists because nodes can share the accessors of EXT_mesh_gpu_instancing. Default:
    /// 2^22 (4,194,304).
    pub max_instances: usize,
    /// The most memory that [`load`](super::load) or [`parse`](super::parse) takes, in bytes: that
    /// of the file, of its buffers and of the parsed document. A file that needs more is refused
    /// with [`AssetError::Limit`](crate::AssetError::Limit) before the memory is
    /// allocated.
    ///
    /// The memory of the document is estimated from its text, and never too low: 1,280
    /// bytes for each JSON object, 256 bytes for each list and each comma, and two bytes for each
    /// byte; all twice if channels of animations have no node. Default: 2^32 (4 GiB).
    pub max_bytes: u64,
}

impl Default for GltfOptions {
    fn default() -> Self {
        Self {
            surfaces: true,
            sides: EmissiveSides::default(),
            texture_noise: 0.3,
            texture_parts: 1 << 16,
            punctual: true,
            policy: Policy::default(),
            max_lights: 1 << 22,
            max_instances: 1 << 22,
            max_bytes: 1 << 32,
        }
    }
}

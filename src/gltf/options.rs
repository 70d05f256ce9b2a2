//! Options for loading lights from a document.

use crate::policy::Policy;

/// Which sides of emissive triangles emit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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

/// What to load from a document, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GltfOptions {
    /// Whether emissive triangles become lights. Default: true.
    pub surfaces: bool,
    /// Factor on the radiance of emissive triangles, finite and at least 0. Default: 1, which keeps
    /// the file's values.
    pub surface_scale: f32,
    /// Which sides of emissive triangles emit. Default: [`EmissiveSides::OfMaterial`].
    pub sides: EmissiveSides,
    /// Whether the lights of KHR_lights_punctual are loaded. Default: true.
    pub punctual: bool,
    /// The policy of every instance. Default: [`Policy::Budgeted`].
    pub policy: Policy,
    /// The most lights that one call creates; a document with more is refused with
    /// [`GltfError::TooManyLights`](super::GltfError::TooManyLights) before memory is allocated for
    /// any of them.
    ///
    /// A tree that several nodes share counts once. The limit exists because a small file can
    /// describe many lights: primitives with different materials can share one accessor. Default:
    /// 2^22 (4,194,304).
    pub max_lights: usize,
}

impl Default for GltfOptions {
    fn default() -> Self {
        Self {
            surfaces: true,
            surface_scale: 1.0,
            sides: EmissiveSides::default(),
            punctual: true,
            policy: Policy::default(),
            max_lights: 1 << 22,
        }
    }
}

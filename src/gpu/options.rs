//! What a [`GpuLights`](super::GpuLights) keeps besides the lights.

use crate::sampling::cuts::CutOptions;
use crate::visibility::VisibilityOptions;

/// What a [`GpuLights`](super::GpuLights) keeps besides the lights. The defaults suit a picture of 1920 × 1080 pixels.
///
/// ```
/// use girandole::VisibilityOptions;
/// use girandole::gpu::GpuOptions;
///
/// let options = GpuOptions::default().with_learning(VisibilityOptions::default());
/// assert!(options.learning.is_some() && options.fragments_write);
/// ```
///
/// A device that cannot bind the buffers of so many cells has half as many, or a quarter and so on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct GpuOptions {
    /// The cells that share cuts. Each that may have a cut takes 1.7 kB of GPU memory, and its places for marks 320 to
    /// 640 bytes: 67 MB by default.
    pub cuts: CutOptions,
    /// The cells that learn which lights are visible, of 7.5 kB each; `None`, the default, for none.
    pub learning: Option<VisibilityOptions>,
    /// Whether fragment shaders may mark cells and record visibility: `true` by default. Devices without
    /// `wgpu::DownlevelFlags::FRAGMENT_WRITABLE_STORAGE` need `false`. There, compute shaders do both, and
    /// fragment shaders choose lights as elsewhere.
    pub fragments_write: bool,
    /// Whether the lights of the last frame are kept, for renderers that reuse samples from frame to frame: `false` by
    /// default. Shaders then have `light_reservoir_sample_previous`
    /// ([`ShaderParts::previous`](super::ShaderParts::previous)) and bind one more storage buffer, which holds
    /// instances and lights a second time. Upload once in each frame, also if nothing has changed: a frame is what lies
    /// between two uploads.
    pub previous: bool,
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self { cuts: CutOptions::default(), learning: None, fragments_write: true, previous: false }
    }
}

impl GpuOptions {
    /// The same with other cells.
    #[must_use]
    pub fn with_cuts(self, cuts: CutOptions) -> Self {
        Self { cuts, ..self }
    }

    /// The same with learnt visibility.
    #[must_use]
    pub fn with_learning(self, learning: VisibilityOptions) -> Self {
        Self { learning: Some(learning), ..self }
    }

    /// The same with the lights of the last frame.
    #[must_use]
    pub fn with_previous(self) -> Self {
        Self { previous: true, ..self }
    }

    /// The same for devices on which fragment shaders write no storage.
    #[must_use]
    pub fn without_fragment_writes(self) -> Self {
        Self { fragments_write: false, ..self }
    }
}

//! What shaders do where no cut is shared.

/// How a shader that [shares cuts](super::super::ShaderParts::cuts) chooses lights for shading points whose cell
/// has no cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum CutFallback {
    /// It walks down from the root of the top level, without splits. Such a shader has no code for cuts of
    /// single points: `light_sample` then has 0.6 to 0.8 of the instructions.
    Walk,
    /// It splits clusters for the point, as shaders do that share no cuts.
    Split,
}

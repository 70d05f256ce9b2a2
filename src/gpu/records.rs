//! The records in an engine's buffers that our own kernels read and write.

use bytemuck::{Pod, Zeroable};

/// A shading point and its random numbers: the input of [`GpuLights::sample`].
///
/// 48 bytes; `Request` in `shaders/request.wgsl`.
///
/// [`GpuLights::sample`]: super::GpuLights::sample
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SampleRequest {
    /// Metres, relative to [`LightWorld::origin`](crate::LightWorld::origin).
    pub position: [f32; 3],
    /// Not read.
    pub padding: u32,
    /// The unit normal of a surface, or zero for a point in a volume.
    pub normal: [f32; 3],
    /// Not read.
    pub padding_after_normal: u32,
    /// Random numbers in [0, 1). The first two choose the light, the last two the point on it.
    pub u: [f32; 4],
}

/// A chosen light and a point on it: what [`GpuLights::sample`] writes for each request.
///
/// If `pmf` is 0, no light was chosen or the chosen point sends nothing: count the sample as black.
/// Otherwise `brdf * cosine * radiance / (pmf * pdf)` estimates the radiance that leaves the
/// shading point, if nothing occludes the light.
///
/// 48 bytes; `LightSample` in `shaders/sample.wgsl`.
///
/// [`GpuLights::sample`]: super::GpuLights::sample
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SampleRecord {
    /// Unit vector from the shading point to the light.
    pub direction: [f32; 3],
    /// Distance to the light in metres; at least 1e18 for a directional light.
    pub dist: f32,
    /// Radiance in nits for a surface. For a light without size, the illuminance in lux of a
    /// surface that faces it.
    pub radiance: [f32; 3],
    /// Density per steradian for a surface, seen from the shading point; 1 for a light without
    /// size.
    pub pdf: f32,
    /// Probability of the light among all lights, in [0, 1]; 0 for a sample that counts as black.
    pub pmf: f32,
    /// Slot of the light's instance, see
    /// [`LightWorld::instance_at`](crate::LightWorld::instance_at); `u32::MAX` for a directional
    /// light.
    pub instance: u32,
    /// Index of the light in its tree, or in the list of
    /// [`LightWorld::directionals`](crate::LightWorld::directionals) at the last upload.
    pub light: u32,
    /// 1 for a light without size: a point, a spot or a directional light. Otherwise 0.
    pub is_delta: u32,
}

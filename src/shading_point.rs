//! The point at which light arrives.

use glam::Vec3;

/// A point that lights are chosen for.
///
/// Make one with [`ShadingPoint::surface`] or [`ShadingPoint::volume`]; later versions may add fields.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ShadingPoint {
    /// Metres, relative to the world's origin (or in a tree's own space).
    pub position: Vec3,
    /// Unit normal of the side that light arrives at. Zero for a point in a volume, which light reaches from all sides.
    pub normal: Vec3,
}

impl ShadingPoint {
    /// A point on a surface. `normal` is a unit vector on the side that is shaded.
    pub fn surface(position: Vec3, normal: Vec3) -> Self {
        Self { position, normal }
    }

    /// A point in a volume.
    pub fn volume(position: Vec3) -> Self {
        Self { position, normal: Vec3::ZERO }
    }
}

//! The point at which light arrives.

use glam::Vec3;

use crate::gloss::Gloss;

/// A point to choose a light for: on a surface, or in a volume such as fog.
///
/// Make one with [`ShadingPoint::surface`] or [`ShadingPoint::volume`]; later versions may add
/// fields.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ShadingPoint {
    /// Position in metres, relative to the world's origin. Methods of
    /// [`LightTree`](crate::LightTree) take it in the tree's own space.
    pub position: Vec3,
    /// Unit normal of the side that light arrives at. Zero for a point in a volume, where light
    /// arrives from all sides.
    pub normal: Vec3,
    /// How a glossy surface reflects; `None` for a matte one. Points in volumes ignore it.
    pub gloss: Option<Gloss>,
}

impl ShadingPoint {
    /// A point on a surface. `normal` is a unit vector that points to the side that is shaded;
    /// lights behind the surface have the probability 0.
    pub fn surface(position: Vec3, normal: Vec3) -> Self {
        Self { position, normal, gloss: None }
    }

    /// A point in a volume, or any other point that light may reach from all sides.
    pub fn volume(position: Vec3) -> Self {
        Self { position, normal: Vec3::ZERO, gloss: None }
    }

    /// The same point with a glossy surface. Lights that the surface reflects toward the viewer
    /// become more probable.
    #[must_use]
    pub fn with_gloss(self, gloss: Gloss) -> Self {
        Self { gloss: Some(gloss), ..self }
    }
}

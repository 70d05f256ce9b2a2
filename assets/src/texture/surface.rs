//! Flat surfaces with the texture coordinates of their corners.

use girandole::{Light, Shape};
use glam::{DVec2, Vec2, Vec3};

use crate::error::{AssetError, invalid};

/// A triangle or a parallelogram that emits an image, or a part of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexturedSurface {
    /// The light for a texture that is white.
    white: Light,
    /// Texture coordinates of three corners: those of [`TexturedSurface::tex_coord`].
    pub(super) tex_coords: [DVec2; 3],
}

impl TexturedSurface {
    /// A one-sided parallelogram that shows a whole image, upright for who looks at its front if `half_u` points to the
    /// right and `half_v` up: see [`Light::rectangle`]. A white texel emits `white` nits.
    pub fn rectangle(center: Vec3, half_u: Vec3, half_v: Vec3, white: Vec3) -> Self {
        let white = Light::rectangle(center, half_u, half_v, white);
        Self { white, tex_coords: [DVec2::Y, DVec2::ONE, DVec2::ZERO] }
    }

    /// A one-sided triangle: see [`Light::triangle`]. A white texel emits `white` nits.
    ///
    /// # Errors
    /// [`AssetError::Invalid`] for a texture coordinate that is not finite.
    pub fn triangle(vertices: [Vec3; 3], tex_coords: [Vec2; 3], white: Vec3) -> Result<Self, AssetError> {
        Self::exact_triangle(vertices, [DVec2::ZERO; 3], white).with_tex_coords(tex_coords)
    }

    /// The same for finite texture coordinates, of more digits.
    pub(crate) fn exact_triangle(vertices: [Vec3; 3], tex_coords: [DVec2; 3], white: Vec3) -> Self {
        Self { white: Light::triangle(vertices, white), tex_coords }
    }

    /// The same surface with other texture coordinates at three of its corners: the vertices of a triangle; of a
    /// parallelogram the corner at `-half_u -half_v`, that at `half_u - half_v`, and that at `half_v - half_u`.
    ///
    /// # Errors
    /// [`AssetError::Invalid`] for a texture coordinate that is not finite.
    pub fn with_tex_coords(self, tex_coords: [Vec2; 3]) -> Result<Self, AssetError> {
        if let Some(value) = tex_coords.into_iter().find(|at| !at.is_finite()) {
            return Err(invalid(format!("the texture coordinates {value} are not finite")));
        }
        Ok(Self { tex_coords: tex_coords.map(|at| at.as_dvec2()), ..self })
    }

    /// The same surface with emission from both sides.
    #[must_use]
    pub fn two_sided(self) -> Self {
        Self { white: self.white.two_sided(), ..self }
    }

    /// The same surface with a range in metres, see [`Light::range`].
    #[must_use]
    pub fn with_range(self, range: f32) -> Self {
        Self { white: self.white.with_range(range), ..self }
    }

    /// The light that the surface is if all of its texels have the colour `mean`.
    pub fn light(&self, mean: Vec3) -> Light {
        self.white.with_emission(self.white.emission * mean)
    }

    /// The texture coordinates of a place on the surface: how far it is along both edges from the first corner, as
    /// [`LightSampler::place_on_light`](girandole::LightSampler::place_on_light) returns it.
    pub fn tex_coord(&self, place: Vec2) -> Vec2 {
        let ([a, b, c], place) = (self.tex_coords, place.as_dvec2());
        (a + (b - a) * place.x + (c - a) * place.y).as_vec2()
    }

    pub(super) fn is_parallelogram(&self) -> bool {
        matches!(self.white.shape, Shape::Rectangle { .. })
    }

    /// The emitting area, as of [`Light::area`].
    pub(super) fn area(&self) -> f64 {
        f64::from(self.white.area().unwrap_or(0.0))
    }

    /// Four parts of the same shape, each half as long.
    pub(super) fn quarters(&self) -> [Self; 4] {
        let [a, b, c] = self.tex_coords;
        let part = |shape: Shape, tex_coords: [DVec2; 3]| Self { white: self.white.with_shape(shape), tex_coords };
        let middle = |from: DVec2, to: DVec2| 0.5 * (from + to);
        match self.white.shape {
            Shape::Rectangle { center, half_u, half_v, two_sided } => {
                let (half_u, half_v) = (0.5 * half_u, 0.5 * half_v);
                let (along_u, along_v) = (0.5 * (b - a), 0.5 * (c - a));
                [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|(u, v): (f32, f32)| {
                    let center = center + half_u * (2.0 * u - 1.0) + half_v * (2.0 * v - 1.0);
                    let first = a + along_u * f64::from(u) + along_v * f64::from(v);
                    let shape = Shape::Rectangle { center, half_u, half_v, two_sided };
                    part(shape, [first, first + along_u, first + along_v])
                })
            }
            Shape::Triangle { vertices: [p, q, r], two_sided } => {
                let half = |from: Vec3, to: Vec3| 0.5 * from + 0.5 * to;
                let (pq, qr, rp) = (half(p, q), half(q, r), half(r, p));
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [
                    ([p, pq, rp], [a, ab, ca]),
                    ([pq, q, qr], [ab, b, bc]),
                    ([rp, qr, r], [ca, bc, c]),
                    ([qr, rp, pq], [bc, ca, ab]),
                ]
                .map(|(vertices, tex_coords)| part(Shape::Triangle { vertices, two_sided }, tex_coords))
            }
            // Surfaces have no other shape.
            _ => [*self; 4],
        }
    }
}

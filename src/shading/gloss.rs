//! Reflection by a rough surface, as the choice of lights sees it: a diffuse part and a GGX part.
//!
//! A cluster of lights is seen in many directions, so the distribution of microfacets is widened by
//! the spread of the half vectors. Based on Tokuyoshi, Ikeda, Kulkarni and Harada, Hierarchical
//! Light Sampling with Accurate Spherical Gaussian Lighting (2024), which widens GGX by a matrix in
//! the space of slopes. Differs: the cluster is a mean and a variance of position instead of a
//! spherical Gaussian, the projected area of a facet is that of the facets that the lobe has, and
//! the shadowing term has no square roots (docs/math.md). Twin of `shaders/gloss.wgsl`.

use glam::{Mat3, Vec3};

/// How a surface reflects light toward a viewer: a diffuse part and a specular part with the GGX
/// distribution of microfacets, as in glTF's materials.
///
/// Give the reflectances that the surface has on average over the visible spectrum, for example the
/// luminances of its colours. They need not be exact: they change which lights are probable, and
/// every light above the horizon keeps a probability above 0.
///
/// A surface counts as matte if the length of `view` is out of range, if a number is not finite, or
/// if `specular` is below 1e-30.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gloss {
    /// The direction to the viewer, in the space of the shading point, with a length from 1e-15 to
    /// 1e18. A view below the horizon counts as grazing.
    pub view: Vec3,
    /// Perceptual roughness, whose square is the α of GGX. It is clamped to the range from 0.032
    /// (nearly a mirror) to 1.
    pub roughness: f32,
    /// Specular reflectance at normal incidence: 0.04 for most materials, more for metals. It rises
    /// toward grazing angles by Schlick's formula. Values above 1 count as 1.
    pub specular: f32,
    /// Diffuse reflectance, which is 0 for metals. It is clamped to the range from 0 to 1.
    pub diffuse: f32,
}

/// The squared lengths of a view that has a direction. Beyond them squares leave f32.
pub(crate) const MIN_VIEW_SQ: f32 = 1.0e-30;
/// See [`MIN_VIEW_SQ`].
pub(crate) const MAX_VIEW_SQ: f32 = 1.0e36;
/// The least specular reflectance. Below it, quotients of reflectances leave f32.
pub(crate) const MIN_SPECULAR: f32 = 1.0e-30;
/// The least α. Lobes of mirrors are for rays along the mirrored direction, not for a choice of
/// lights.
pub(crate) const MIN_ALPHA: f32 = 1.0e-3;
/// The least cosine between the view and the normal.
pub(crate) const MIN_VIEW_COSINE: f32 = 0.01;
/// The least squared sine between the view and the normal for which their plane is known.
pub(crate) const MIN_VIEW_SINE_SQ: f32 = 1.0e-6;
/// How much a cluster widens the squared width of the distribution of slopes, per unit of its
/// angular size. Measured in docs/decisions.md, 46.
pub(crate) const GLOSS_WIDTH: f32 = 0.4;
/// The share of the reflectance that counts as reflected to all sides. Clusters may have lights in
/// the lobe although their mean is outside.
pub(crate) const MIN_GLOSS: f32 = 0.02;

/// A gloss in the space of a tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalGloss {
    /// Its dot product with a vector of the tree's space is the coordinate of that vector along a
    /// tangent of the surface in the world: the tangent in the plane of the view and the normal. A
    /// unit vector if the tree is not scaled or sheared.
    tangent: Vec3,
    /// The same for the tangent across that plane.
    bitangent: Vec3,
    /// The view along the tangent and along the normal.
    view: [f32; 2],
    alpha: f32,
    /// 1 / α².
    inverse_alpha_sq: f32,
    /// Specular reflectance at normal incidence.
    specular: f32,
    /// What is reflected alike to all sides.
    flat: f32,
}

impl LocalGloss {
    /// The gloss of a surface in the space of its shading point; `None` if it is matte. `normal` is
    /// a unit vector, or zero in a volume.
    pub fn of(gloss: &Gloss, normal: Vec3) -> Option<Self> {
        let Gloss { roughness, specular, diffuse, .. } = *gloss;
        let view_sq = gloss.view.length_squared();
        // NaN fails the comparisons.
        let has_view = (MIN_VIEW_SQ..=MAX_VIEW_SQ).contains(&view_sq);
        let is_finite = [roughness, specular, diffuse].into_iter().all(|value| value.abs() <= f32::MAX);
        if normal == Vec3::ZERO || !has_view || !is_finite || specular < MIN_SPECULAR {
            return None;
        }
        let view = gloss.view / view_sq.sqrt();
        let (specular, diffuse) = (specular.min(1.0), diffuse.clamp(0.0, 1.0));
        let cosine = view.dot(normal);
        let across = view - normal * cosine;
        let sine_sq = across.length_squared();
        let has_plane = sine_sq > MIN_VIEW_SINE_SQ;
        let sine = if has_plane { sine_sq.sqrt() } else { 0.0 };
        let tangent = if has_plane { across / sine } else { normal.any_orthonormal_vector() };
        let roughness = roughness.clamp(0.0, 1.0);
        let alpha = (roughness * roughness).max(MIN_ALPHA);
        Some(Self {
            tangent,
            bitangent: normal.cross(tangent),
            view: [sine, cosine.max(MIN_VIEW_COSINE)],
            alpha,
            inverse_alpha_sq: 1.0 / (alpha * alpha),
            specular,
            flat: diffuse + MIN_GLOSS * (diffuse + specular),
        })
    }

    /// The same gloss in the space of an instance's tree. `to_world` is the linear part of its
    /// placement.
    pub fn carried(&self, to_world: &Mat3) -> Self {
        let back = to_world.transpose();
        Self { tangent: back * self.tangent, bitangent: back * self.bitangent, ..*self }
    }

    /// The coordinates of a vector of the tree's space along the tangents of the world.
    #[inline(always)]
    pub fn along(&self, v: [f32; 3]) -> [f32; 2] {
        let (t, b) = (self.tangent, self.bitangent);
        [t.x * v[0] + t.y * v[1] + t.z * v[2], b.x * v[0] + b.y * v[1] + b.z * v[2]]
    }

    /// The reflectance for light from a unit direction of the world: π times the BRDF.
    pub fn toward(&self, direction: Vec3, cosine: f32) -> f32 {
        let [x, y] = self.along(direction.to_array());
        self.reflected(x, y, cosine, 0.0).0
    }

    /// The reflectance for a cluster of lights, which is π times the mean of the BRDF, and the
    /// doubt about it relative to the cluster's importance.
    ///
    /// `x` and `y` are the coordinates of the unit vector to the mean position along the tangents,
    /// `z` is the positive cosine at the surface, and `spread` is the cluster's angular size from 0
    /// to 1.
    #[inline(always)]
    pub fn reflected(&self, x: f32, y: f32, z: f32, spread: f32) -> (f32, f32) {
        let Self { view: [view_x, view_z], alpha, .. } = *self;
        let alpha_sq = alpha * alpha;
        // The slopes of the half vector, and the covariance that the cluster gives to them.
        let height = z + view_z;
        let inverse = 1.0 / height;
        let (slope_x, slope_y) = ((x + view_x) * inverse, y * inverse);
        let (along_x, along_y) = (x - slope_x * z, y - slope_y * z);
        let width = GLOSS_WIDTH * spread * (inverse * inverse);
        let xx = alpha_sq + width * (1.0 + slope_x * slope_x - along_x * along_x);
        let xy = width * (slope_x * slope_y - along_x * along_y);
        let yy = alpha_sq + width * (1.0 + slope_y * slope_y - along_y * along_y);
        let det = max(xx * yy - xy * xy, alpha_sq * alpha_sq);
        let (square_x, square_y) = (slope_x * slope_x, slope_y * slope_y);
        let outside = square_x * yy - 2.0 * (slope_x * slope_y) * xy + square_y * xx;
        // A lobe that is widened has facets of all slopes below its width: their area, not that of
        // the half vector at the mean, turns slopes into directions.
        let slope_sq = square_x + square_y;
        let area = 1.0 + slope_sq * (2.0 * alpha_sq / (xx + yy));
        let half_cosine = 0.5 * height * area.sqrt();
        let grazing = max(1.0 - half_cosine, 0.0);
        let grazing_sq = grazing * grazing;
        let fresnel = self.specular + (1.0 - self.specular) * (grazing_sq * grazing_sq * grazing);
        let product = 2.0 * z * view_z;
        let shadowing = product + alpha * (height - product);
        // One division for the distribution and the shadowing: this is a hot loop.
        let below = (det + outside) * (det + outside);
        let lobe = 0.5 * fresnel * (area * area) * (det * det.sqrt()) / (below * shadowing);
        let reflected = self.flat + lobe;
        (reflected, lobe / reflected * (width * (1.0 + area) * self.inverse_alpha_sq))
    }
}

/// Faster than [`f32::max`]: see `importance.rs`.
#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

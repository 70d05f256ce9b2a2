//! What a node knows of the lights below it: bounds that prove where they cannot shine, and moments that tell how
//! brightly they probably do.

use glam::{Mat3, Vec3};

use crate::bounds::Aabb;

/// Columns of a matrix whose scaled Gram matrix is this close to the identity preserve angles to about 1e-5 rad,
/// which is inside the margin that the sampling code leaves around every cap.
const SIMILARITY_TOLERANCE: f32 = 1.0e-5;

/// A matrix whose Gram matrix is this close to the identity, entry by entry, only turns: its transpose is its inverse,
/// to that share of the coordinates. Some ten products of rotations in f32 stay inside.
pub(crate) const RIGID_TOLERANCE: f32 = 4.0e-6;

/// The most flux that one light or many count as, in lumens: products of it with every factor of the importance stay
/// inside f32. Only wrong units get there; what is above it is still sampled, by position alone.
pub(crate) const MAX_FLUX: f32 = 1.0e34;

/// A mean direction shorter than this counts as none: the squares of what is left after emitters cancelled would be
/// below f32, and a cap about what is no unit vector proves nothing.
pub(crate) const MIN_AXIS: f32 = 1.0e-12;

/// A group of lights. Box, cap of directions and range are conservative; mean, variance and axis are weighted by flux.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cluster {
    /// Holds every emitting point, in metres.
    pub aabb: Aabb,
    /// Lumens; 0 means that nothing of it shines.
    pub flux: f32,
    /// Lumens of surfaces among them: an instance's scale changes these only.
    pub area_flux: f32,
    /// Mean position.
    pub mean: Vec3,
    /// Trace of the covariance of position about `mean`, in square metres.
    pub variance: f32,
    /// Mean direction of emission. Length 0 (to all sides alike) to 1 (a beam).
    pub axis: Vec3,
    /// Cosine of the half-angle of the cap about `axis` that holds every direction that any of them emits to; -1 is all
    /// directions.
    pub cos_half_angle: f32,
    /// The largest range, in metres.
    pub range: f32,
}

impl Cluster {
    /// No light.
    pub const EMPTY: Self = Self {
        aabb: Aabb::EMPTY,
        flux: 0.0,
        area_flux: 0.0,
        mean: Vec3::ZERO,
        variance: 0.0,
        axis: Vec3::ZERO,
        cos_half_angle: 1.0,
        range: 0.0,
    };

    /// The cluster carried by `x -> linear * x + translation`.
    ///
    /// `flux` is what the moved lights emit, see [`Linear::flux`]. Boxes stay conservative; the cap too: it is turned
    /// by transforms that keep angles and given up (all directions) by all others. Ranges are metres of the world and stay.
    pub fn transformed(&self, map: &Linear, translation: Vec3, flux: f32) -> Self {
        // Of unit length first: areas at the least scale times a short mean direction have squares below f32.
        let axis = map.cofactor * self.axis.normalize_or_zero();
        Self {
            aabb: self.aabb.transformed(&map.linear, translation),
            flux,
            area_flux: self.area_flux.min(flux),
            mean: map.linear * self.mean + translation,
            variance: self.variance * map.mean_square_scale,
            axis: axis.normalize_or_zero() * self.axis.length(),
            cos_half_angle: if map.is_similarity { self.cos_half_angle } else { -1.0 },
            range: self.range,
        }
    }
}

impl Default for Cluster {
    fn default() -> Self {
        Self::EMPTY
    }
}

/// The linear part of a placement with what follows from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    /// Columns are the images of the axes.
    pub linear: Mat3,
    /// Carries normals with their area: the matrix of cofactors, its sign changed for mirrors.
    pub cofactor: Mat3,
    /// Of `linear`.
    pub determinant: f32,
    /// Keeps angles (rotation, mirror, uniform scale).
    pub is_similarity: bool,
    /// Mean of the squared singular values.
    pub mean_square_scale: f32,
    /// A lower bound of the least singular value.
    pub least_scale: f32,
}

impl Linear {
    /// Whether it only turns: no scale, shear or mirror.
    pub(crate) fn is_rigid(&self) -> bool {
        let gram = self.linear.transpose() * self.linear - Mat3::IDENTITY;
        self.determinant > 0.0 && gram.to_cols_array().iter().all(|e| e.abs() <= RIGID_TOLERANCE)
    }

    /// Derives the rest from a matrix with an inverse.
    pub fn new(linear: Mat3) -> Self {
        let (x, y, z) = (linear.x_axis, linear.y_axis, linear.z_axis);
        // In f64: an inverse that lost its digits would bound nothing.
        let exact = linear.as_dmat3();
        let determinant = exact.determinant() as f32;
        let cofactor = Mat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * determinant.signum();
        let mean_square_scale = (x.length_squared() + y.length_squared() + z.length_squared()) / 3.0;
        let gram = linear.transpose() * linear;
        let off = (gram - Mat3::from_diagonal(Vec3::splat(mean_square_scale))).to_cols_array();
        let is_similarity = off.iter().all(|e| e.abs() <= SIMILARITY_TOLERANCE * mean_square_scale);
        let least_scale = if is_similarity {
            mean_square_scale.sqrt() * (1.0 - SIMILARITY_TOLERANCE)
        } else {
            // The inverse's Frobenius norm bounds its largest singular value.
            let inverse = exact.inverse().to_cols_array();
            (1.0 / inverse.iter().map(|e| e * e).sum::<f64>().sqrt()) as f32
        };
        Self { linear, cofactor, determinant, is_similarity, mean_square_scale, least_scale }
    }

    /// What a cluster emits when it is carried along: points and spots keep their flux, areas change.
    ///
    /// `axis` is the cluster's mean direction. The factor of an area is that of its normal as far as the normals agree,
    /// and the mean over all normals for the rest; exact for uniform scales and for flat emitters.
    pub fn flux(&self, punctual: f32, area: f32, axis: Vec3) -> f32 {
        let all_sides = (self.cofactor.to_cols_array().iter().map(|e| e * e).sum::<f32>() / 3.0).sqrt();
        // A flat emitter has a mean direction of length 2/3.
        let agreement = (1.5 * axis.length()).min(1.0);
        let along = (self.cofactor * axis.normalize_or_zero()).length();
        (punctual + area * (agreement * along + (1.0 - agreement) * all_sides)).min(MAX_FLUX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_of_ten_rotations_are_rigid_and_scales_and_mirrors_are_not() {
        for i in 0..5000 {
            let axis =
                |k: usize| Vec3::new((k as f32).sin(), (1.7 * k as f32).cos(), (2.3 * k as f32).sin()).normalize();
            let turn = (0..10).fold(Mat3::IDENTITY, |m, k| m * Mat3::from_axis_angle(axis(10 * i + k), (i + k) as f32));
            assert!(Linear::new(turn).is_rigid(), "{turn}");
            assert!(!Linear::new(turn * 1.00001).is_rigid());
            assert!(!Linear::new(turn * Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0))).is_rigid());
        }
    }

    #[test]
    fn a_uniform_scale_changes_area_flux_by_its_square_and_a_mirror_by_nothing() {
        let axis = Vec3::new(0.0, 2.0 / 3.0, 0.0);
        let triple = Linear::new(Mat3::from_diagonal(Vec3::splat(3.0)));
        assert!((triple.flux(5.0, 2.0, axis) - 23.0).abs() < 1e-4);
        assert!(triple.is_similarity && !triple.is_rigid());
        let mirror = Linear::new(Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)));
        assert!((mirror.flux(5.0, 2.0, Vec3::ZERO) - 7.0).abs() < 1e-5);
        assert!(mirror.is_similarity && !mirror.is_rigid());
        // A mirrored emitter that faces x faces -x afterwards, as its mirrored geometry does.
        assert!((mirror.cofactor * Vec3::X + Vec3::X).length() < 1e-6);
        let flat = Linear::new(Mat3::from_diagonal(Vec3::new(2.0, 7.0, 3.0)));
        assert!((flat.flux(0.0, 1.0, axis) - 6.0).abs() < 1e-5);
        assert!(!flat.is_similarity && flat.least_scale <= 2.0 && flat.least_scale > 1.0);
    }
}

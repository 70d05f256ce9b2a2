//! What a node knows of the lights below it: bounds that prove where they cannot shine, and moments that tell how
//! brightly they probably do.

use glam::{Mat3, Vec3};

use crate::bounds::Aabb;
use crate::cone::Cone;

/// Columns of a matrix whose scaled Gram matrix is this close to the identity preserve angles to about 1e-5 rad,
/// which is inside the margin that the sampling code leaves around every cone.
const SIMILARITY_TOLERANCE: f32 = 1.0e-5;

/// The most flux that one light or many count as, in lumens: products of it with every factor of the importance stay
/// inside f32. Only wrong units get there; what is above it is still sampled, by position alone.
pub(crate) const MOST_FLUX: f32 = 1.0e34;

/// A group of lights. Box and cone are conservative; mean, variance and axis are weighted by flux.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cluster {
    /// Holds every emitting point, in metres.
    pub aabb: Aabb,
    /// Holds every direction that any of them emits to.
    pub cone: Cone,
    /// Lumens.
    pub flux: f32,
    /// Mean position.
    pub mean: Vec3,
    /// Trace of the covariance of position about `mean`, in square metres.
    pub variance: f32,
    /// Mean direction of emission. Length 0 (to all sides alike) to 1 (a beam).
    pub axis: Vec3,
    /// The largest range, in metres.
    pub range: f32,
}

impl Cluster {
    /// No light: the identity of [`Cluster::merge`] (but for the mean of groups without flux).
    pub const EMPTY: Self = Self {
        aabb: Aabb::EMPTY,
        cone: Cone::EMPTY,
        flux: 0.0,
        mean: Vec3::ZERO,
        variance: 0.0,
        axis: Vec3::ZERO,
        range: 0.0,
    };

    /// The cluster of both groups.
    ///
    /// Means and variances by the pairwise update of Chan, Golub and LeVeque (1979), which does not cancel far from the origin.
    pub fn merge(&self, other: &Self) -> Self {
        let flux = self.flux + other.flux;
        let share = if flux > 0.0 { other.flux / flux } else { 0.0 };
        let flux = flux.min(MOST_FLUX);
        let apart = other.mean - self.mean;
        Self {
            aabb: self.aabb.union(&other.aabb),
            cone: self.cone.union(&other.cone),
            flux,
            mean: if share == 1.0 { other.mean } else { self.mean + apart * share },
            variance: (1.0 - share) * self.variance
                + share * other.variance
                + share * (1.0 - share) * apart.length_squared(),
            axis: self.axis * (1.0 - share) + other.axis * share,
            range: self.range.max(other.range),
        }
    }

    /// The cluster carried by `x -> linear * x + translation`.
    ///
    /// `flux` is what the moved lights emit, see [`Linear::flux`]. Boxes stay conservative; the cone too: it is turned
    /// by transforms that keep angles and given up (full sphere) by all others. Ranges are metres of the world and stay.
    pub fn transformed(&self, map: &Linear, translation: Vec3, flux: f32) -> Self {
        let cone = if self.cone.is_empty() || self.cone.is_full() {
            self.cone
        } else if map.is_similarity {
            Cone { axis: (map.linear * self.cone.axis).normalize_or(self.cone.axis), ..self.cone }
        } else {
            Cone::FULL
        };
        let axis = map.cofactor * self.axis;
        Self {
            aabb: self.aabb.transformed(&map.linear, translation),
            cone,
            flux,
            mean: map.linear * self.mean + translation,
            variance: self.variance * map.mean_square_scale,
            axis: axis.normalize_or_zero() * self.axis.length(),
            range: self.range,
        }
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
        (punctual + area * (agreement * along + (1.0 - agreement) * all_sides)).min(MOST_FLUX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Light;

    #[test]
    fn merging_matches_sums_over_the_lights_far_from_the_origin() {
        // Positions there are 8 mm apart, the lights 1 m: what merging adds to that must stay small.
        let far = Vec3::new(1.0e5, -1.0e5, 1.0e5);
        let lights: Vec<_> = (0..50)
            .map(|i| Light::point(far + Vec3::new(i as f32, 0.25 * i as f32, 0.0), Vec3::splat(1.0 + i as f32)))
            .collect();
        let all = lights.iter().map(Light::cluster).reduce(|a, b| a.merge(&b)).unwrap();
        let weight: f64 = lights.iter().map(|l| f64::from(l.flux())).sum();
        let mean =
            lights.iter().map(|l| l.cluster().mean.as_dvec3() * f64::from(l.flux())).sum::<glam::DVec3>() / weight;
        let variance = lights
            .iter()
            .map(|l| (l.cluster().mean.as_dvec3() - mean).length_squared() * f64::from(l.flux()))
            .sum::<f64>()
            / weight;
        assert!((f64::from(all.variance) / variance - 1.0).abs() < 1e-2, "{} {variance}", all.variance);
        assert!(all.mean.as_dvec3().distance(mean) < 0.05);
        assert!((f64::from(all.flux) / weight - 1.0).abs() < 1e-5);
    }

    #[test]
    fn a_uniform_scale_changes_area_flux_by_its_square_and_a_mirror_by_nothing() {
        let axis = Vec3::new(0.0, 2.0 / 3.0, 0.0);
        let triple = Linear::new(Mat3::from_diagonal(Vec3::splat(3.0)));
        assert!((triple.flux(5.0, 2.0, axis) - 23.0).abs() < 1e-4);
        assert!(triple.is_similarity);
        let mirror = Linear::new(Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)));
        assert!((mirror.flux(5.0, 2.0, Vec3::ZERO) - 7.0).abs() < 1e-5);
        assert!(mirror.is_similarity);
        // A mirrored emitter that faces x faces -x afterwards, as its mirrored geometry does.
        assert!((mirror.cofactor * Vec3::X + Vec3::X).length() < 1e-6);
        let flat = Linear::new(Mat3::from_diagonal(Vec3::new(2.0, 7.0, 3.0)));
        assert!((flat.flux(0.0, 1.0, axis) - 6.0).abs() < 1e-5);
        assert!(!flat.is_similarity && flat.least_scale <= 2.0 && flat.least_scale > 1.0);
    }
}

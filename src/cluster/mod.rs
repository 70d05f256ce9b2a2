//! Clusters: summaries of groups of lights. Bounds prove where none of their light arrives, and
//! moments estimate how much arrives elsewhere.
//!
//! Tools that look into trees need this module; engines do not. Its types follow what the trees
//! store, so any release may change them.

pub(crate) mod bounds;
pub(crate) mod cone;

use glam::{DMat3, Mat3, Vec2, Vec3};

pub use bounds::Aabb;
pub use cone::Cone;

/// A matrix whose scaled Gram matrix is this close to the identity preserves angles to about 1e-5
/// rad. This is inside the margin that the sampling code leaves around every cap.
const SIMILARITY_TOLERANCE: f32 = 1.0e-5;

/// Added to the angle of [`Linear::turn`] for rounding, in radians.
const TURN_MARGIN: f64 = 1.0e-6;

/// Angles of [`Linear::turn`] from here on count as half a turn: such caps prove next to nothing.
const MAX_TURN: f64 = 3.0;

/// A matrix whose Gram matrix is this close to the identity, entry by entry, is a rotation. Its
/// transpose is its inverse up to this share of the coordinates. Products of about ten rotations in
/// f32 stay inside.
pub(crate) const RIGID_TOLERANCE: f32 = 4.0e-6;

/// The largest flux that one light or many lights count as, in lumens. Products of it with every
/// factor of the importance stay inside f32. Only wrong units exceed it; lights that do are still
/// sampled, by position alone.
pub(crate) const MAX_FLUX: f32 = 1.0e34;

/// Largest absolute value of an entry of a linear part, and the inverse of the least scale.
/// Squares of cofactors then stay within f32.
pub const MAX_SCALE: f32 = 1.0e9;

/// A mean direction shorter than this counts as none. It is what is left after emitters have
/// cancelled: its square may underflow f32, and a cap about a vector that is not of unit length
/// proves nothing.
pub(crate) const MIN_AXIS: f32 = 1.0e-12;

/// A group of lights. The box, the cap of directions and the range are conservative. The mean, the
/// variance and the axis are weighted by flux.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cluster {
    /// Contains every emitting point, in metres.
    pub aabb: Aabb,
    /// The flux of all lights, in lumens. 0 if all of them are dark.
    pub flux: f32,
    /// The part of the flux that comes from surfaces, in lumens. An instance's scale changes only
    /// this part.
    pub area_flux: f32,
    /// The part of the flux that comes from lights without size, in lumens. Not the difference of
    /// the other two: in a small instance, surfaces far outshine it in the tree's space, but not in
    /// the world.
    pub punctual_flux: f32,
    /// Mean position, in metres.
    pub mean: Vec3,
    /// Trace of the covariance of position about `mean`, in square metres.
    pub variance: f32,
    /// Mean direction of emission. Its length is 0 for emission to all sides and 1 for a beam.
    pub axis: Vec3,
    /// Cosine of the half-angle of the cap about `axis` that contains every direction of emission.
    /// -1 is all directions.
    pub cos_half_angle: f32,
    /// The largest range, in metres.
    pub range: f32,
}

impl Cluster {
    /// A cluster without lights: dark, with an empty box.
    pub const EMPTY: Self = Self {
        aabb: Aabb::EMPTY,
        flux: 0.0,
        area_flux: 0.0,
        punctual_flux: 0.0,
        mean: Vec3::ZERO,
        variance: 0.0,
        axis: Vec3::ZERO,
        cos_half_angle: 1.0,
        range: 0.0,
    };

    /// The cluster after the transform `x -> linear * x + translation`.
    ///
    /// `flux` is the flux of the transformed lights, see [`Linear::flux`]. The box stays
    /// conservative. So does the cap: a transform that preserves angles rotates it, and any other
    /// transform widens it. The range stays, since it is in metres of the world.
    #[must_use]
    pub fn transformed(&self, map: &Linear, translation: Vec3, flux: f32) -> Self {
        // Normalise first: the square of an area at the least scale times a short mean direction
        // underflows.
        let axis = map.cofactor * self.axis.normalize_or_zero();
        Self {
            aabb: self.aabb.transformed(&map.linear, translation),
            flux,
            area_flux: self.area_flux.min(flux),
            punctual_flux: self.punctual_flux.min(flux),
            mean: map.linear * self.mean + translation,
            variance: self.variance * map.mean_square_scale,
            axis: axis.normalize_or_zero() * self.axis.length(),
            // Once for directions of lights against the axis, and once for the axis, which turns
            // as normals do, against spots, which do not.
            cos_half_angle: map.widened(map.widened(self.cos_half_angle)),
            range: self.range,
        }
    }
}

impl Default for Cluster {
    fn default() -> Self {
        Self::EMPTY
    }
}

/// The linear part of a placement, with values that are derived from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    /// The matrix. Its columns are the images of the axes.
    pub linear: Mat3,
    /// Transforms a normal whose length is an area: the matrix of cofactors, negated for mirrors.
    pub cofactor: Mat3,
    /// The determinant of `linear`.
    pub determinant: f32,
    /// Whether the transform preserves angles: it consists of rotations, mirrors and uniform
    /// scales.
    pub is_similarity: bool,
    /// Cosine and sine of the angle by which the transform may turn one direction against another,
    /// from (1, 0) for a similarity to (-1, 0) for half a turn.
    pub turn: Vec2,
    /// The mean of the squared singular values.
    pub mean_square_scale: f32,
    /// A lower bound of the least singular value. 0 if `linear` is singular or has an entry that is
    /// not finite.
    pub least_scale: f32,
}

impl Linear {
    /// Whether the transform is a rotation, without scale, shear or mirror.
    pub(crate) fn is_rigid(&self) -> bool {
        let gram = self.linear.transpose() * self.linear - Mat3::IDENTITY;
        self.determinant > 0.0 && gram.to_cols_array().iter().all(|e| e.abs() <= RIGID_TOLERANCE)
    }

    /// Derives all values from a matrix, which may be singular.
    pub fn new(linear: Mat3) -> Self {
        let (x, y, z) = (linear.x_axis, linear.y_axis, linear.z_axis);
        // In f64: an inverse that lost its digits would bound nothing.
        let exact = linear.as_dmat3();
        let exact_determinant = exact.determinant();
        let determinant = exact_determinant as f32;
        // In f32, products that cancel would lose the digits of flattened placements.
        let [dx, dy, dz] = [exact.x_axis, exact.y_axis, exact.z_axis];
        let cofactor =
            (DMat3::from_cols(dy.cross(dz), dz.cross(dx), dx.cross(dy)) * exact_determinant.signum()).as_mat3();
        let mean_square_scale = (x.length_squared() + y.length_squared() + z.length_squared()) / 3.0;
        let gram = linear.transpose() * linear;
        let error = (gram - Mat3::from_diagonal(Vec3::splat(mean_square_scale))).to_cols_array();
        let is_similarity = error.iter().all(|e| e.abs() <= SIMILARITY_TOLERANCE * mean_square_scale);
        // Test for singularity before inverting: glam's assertions, if enabled, panic on a
        // determinant of 0.
        let is_invertible = exact_determinant != 0.0 && exact_determinant.is_finite();
        let norm = |entries: [f64; 9]| entries.iter().map(|e| e * e).sum::<f64>().sqrt();
        let (least_scale, turn) = if is_similarity {
            (mean_square_scale.sqrt() * (1.0 - SIMILARITY_TOLERANCE), Vec2::X)
        } else if !is_invertible {
            (0.0, Vec2::NEG_X)
        } else {
            // The Frobenius norm of the inverse bounds its largest singular value.
            let inverse_norm = norm(exact.inverse().to_cols_array());
            ((1.0 / inverse_norm) as f32, greatest_turn(norm(exact.to_cols_array()) * inverse_norm))
        };
        Self { linear, cofactor, determinant, is_similarity, turn, mean_square_scale, least_scale }
    }

    /// The cosine of the half-angle of a cap that is widened by [`Self::turn`]: -1 if it becomes
    /// all directions.
    pub(crate) fn widened(&self, cos: f32) -> f32 {
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        if cos <= -self.turn.x { -1.0 } else { cos * self.turn.x - sin * self.turn.y }
    }

    /// The flux of a cluster after the transform, in lumens: points and spots keep their flux, and
    /// the flux of surfaces changes with their area.
    ///
    /// `axis` is the cluster's mean direction. As far as the normals agree, an area changes by the
    /// factor of its normal; for the rest it changes by the mean factor of all normals. Exact for
    /// uniform scales and for flat emitters. At most 1e34.
    pub fn flux(&self, punctual: f32, area: f32, axis: Vec3) -> f32 {
        let all_sides = self.mean_area_scale();
        // A flat emitter has a mean direction of length 2/3.
        let agreement = (1.5 * axis.length()).min(1.0);
        let along = (self.cofactor * axis.normalize_or_zero()).length();
        (punctual + area * (agreement * along + (1.0 - agreement) * all_sides)).min(MAX_FLUX)
    }

    /// The mean factor of areas over all normals.
    pub(crate) fn mean_area_scale(&self) -> f32 {
        (self.cofactor.to_cols_array().iter().map(|e| e * e).sum::<f32>() / 3.0).sqrt()
    }
}

/// Cosine and sine of the greatest angle by which a matrix turns two directions against each other,
/// at most half a turn. `norms` is the product of the Frobenius norms of the matrix and its
/// inverse.
///
/// The angle is 4 atan(√κ) − π, where κ is the greatest by the least singular value
/// (docs/math.md, Placements). The product of the norms is at least κ + 1 + 1/κ.
fn greatest_turn(norms: f64) -> Vec2 {
    let twice = norms - 1.0;
    let condition = 0.5 * (twice + (twice * twice - 4.0).max(0.0).sqrt());
    let angle = 4.0 * condition.sqrt().atan() - std::f64::consts::PI + TURN_MARGIN;
    if angle < MAX_TURN { Vec2::new(angle.cos() as f32, angle.sin() as f32) } else { Vec2::NEG_X }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_of_ten_rotations_is_rigid_and_scales_and_mirrors_are_not() {
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
    fn a_uniform_scale_changes_area_flux_by_its_square_and_a_mirror_does_not_change_it() {
        let axis = Vec3::new(0.0, 2.0 / 3.0, 0.0);
        let triple = Linear::new(Mat3::from_diagonal(Vec3::splat(3.0)));
        assert!((triple.flux(5.0, 2.0, axis) - 23.0).abs() < 1e-4);
        assert!(triple.is_similarity && !triple.is_rigid());
        let mirror = Linear::new(Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)));
        assert!((mirror.flux(5.0, 2.0, Vec3::ZERO) - 7.0).abs() < 1e-5);
        assert!(mirror.is_similarity && !mirror.is_rigid());
        // An emitter that faces x faces -x after the mirror, as its mirrored geometry does.
        assert!((mirror.cofactor * Vec3::X + Vec3::X).length() < 1e-6);
        let flat = Linear::new(Mat3::from_diagonal(Vec3::new(2.0, 7.0, 3.0)));
        assert!((flat.flux(0.0, 1.0, axis) - 6.0).abs() < 1e-5);
        assert!(!flat.is_similarity && flat.least_scale <= 2.0 && flat.least_scale > 1.0);
    }

    #[test]
    fn no_two_directions_turn_by_more_than_the_bound_and_some_by_all_of_it() {
        let unit = |k: f32| Vec3::new((3.1 * k).sin(), (1.7 * k).cos(), (2.3 * k + 1.0).sin()).normalize();
        let turn_of = |map: &Linear| f64::from(map.turn.y).atan2(f64::from(map.turn.x));
        for (stretch, rotation) in [(1.0001, 0.3), (1.05, 1.1), (1.5, 2.0), (4.0, 2.9)] {
            let stretched = Mat3::from_diagonal(Vec3::new(stretch, 1.0, 1.0 / stretch));
            let map = Linear::new(Mat3::from_axis_angle(unit(rotation), rotation) * stretched);
            let bound = turn_of(&map);
            // The directions of the greatest turn lie to both sides of the axis that shrinks least,
            // by atan(√κ), where κ is the square of `stretch`: the angle between their images is
            // known.
            let expected = 2.0 * (f64::from(stretch).atan() - f64::from(1.0 / stretch).atan());
            assert!((bound - expected).abs() < 1.0e-4 * expected + 1.0e-5, "{stretch}: {bound} for {expected}");
            let (mut greatest, exact) = (0.0_f64, map.linear.as_dmat3());
            for i in 0..20_000 {
                let (a, b) = (unit(i as f32).as_dvec3(), unit(1.37 * i as f32 + 0.2).as_dvec3());
                let turned = (exact * a).angle_between(exact * b) - a.angle_between(b);
                greatest = greatest.max(turned.abs());
            }
            assert!(greatest <= bound && greatest > 0.8 * bound, "{stretch}: {greatest} of {bound}");
        }
    }

    #[test]
    fn caps_widen_by_the_turn_and_stay_as_they_are_under_similarities() {
        let map = Linear::new(Mat3::from_cols(Vec3::X, Vec3::new(0.05, 1.0, 0.0), Vec3::Z));
        let turn = map.turn.y.atan2(map.turn.x);
        assert!(turn > 0.04 && turn < 0.06, "{turn}");
        for half_angle in [0.0_f32, 0.1, 1.0, 2.0, 3.0] {
            let widened = map.widened(half_angle.cos());
            assert!((widened.acos() - half_angle - turn).abs() < 1.0e-3, "{half_angle}");
            let similar = Linear::new(Mat3::from_diagonal(Vec3::splat(7.0)));
            assert_eq!(similar.widened(half_angle.cos()), half_angle.cos());
        }
        assert_eq!(map.widened((std::f32::consts::PI - 0.9 * turn).cos()), -1.0);
        let squashed = Linear::new(Mat3::from_diagonal(Vec3::new(1.0e-3, 1.0, 1.0)));
        assert_eq!(squashed.widened(1.0), -1.0);
    }

    #[test]
    fn a_matrix_that_is_singular_or_not_finite_has_a_least_scale_of_zero() {
        let column = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        let singular = [
            Mat3::ZERO,
            Mat3::from_diagonal(column(1.0, 0.0, 1.0)),
            Mat3::from_diagonal(column(0.0, 3.0, 0.0)),
            Mat3::from_cols(column(1.0, 2.0, 3.0), column(2.0, 4.0, 6.0), column(0.0, 1.0, 0.0)),
            Mat3::from_diagonal(column(1.0, f32::NAN, 1.0)),
            Mat3::from_diagonal(column(f32::INFINITY, 1.0, 1.0)),
        ];
        for matrix in singular {
            assert_eq!(Linear::new(matrix).least_scale, 0.0, "{matrix}");
        }
        // The cofactors are known even where there is no inverse: here the z axis keeps its normal.
        assert_eq!(Linear::new(Mat3::from_diagonal(column(2.0, 3.0, 0.0))).cofactor * Vec3::Z, 6.0 * Vec3::Z);
    }
}

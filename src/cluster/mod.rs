//! Clusters: summaries of groups of lights. Bounds prove where none of their light arrives, and
//! moments estimate how much arrives elsewhere.
//!
//! Tools that look into trees need this module; engines do not. Its types follow what the trees
//! store, so any release may change them.

pub(crate) mod bounds;
pub(crate) mod cone;

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec3, Mat3, Vec2, Vec3};

pub use bounds::Aabb;
pub use cone::Cone;

/// A matrix whose scaled Gram matrix is this close to the identity preserves angles to about 1e-5
/// rad. This is inside the margin that the sampling code leaves around every cap.
const SIMILARITY_TOLERANCE: f32 = 1.0e-5;

/// Added to the condition, as a share, for rounding.
const SCALE_MARGIN: f64 = 1.0e-6;

/// The rounding of the image of a normal, as a share of the greatest such image.
pub(crate) const AXIS_ROUNDING: f32 = 1.0e-6;

/// Angles of [`Linear::turn`] from here on count as half a turn: such caps prove next to nothing, and
/// the rounding of their axes grows with the condition.
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
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
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
    /// conservative, and so does the cap (`Linear::cap`). The range stays, since it is in metres of
    /// the world.
    #[must_use]
    pub fn transformed(&self, map: &Linear, translation: Vec3, flux: f32) -> Self {
        // Normalise first: the square of an area at the least scale times a short mean direction
        // underflows.
        let emitters = Emitters::of(self.punctual_flux, self.area_flux, self.area_flux > 0.0);
        let (axis, cos_half_angle) = map.cap(emitters, self.axis.normalize_or_zero(), self.cos_half_angle);
        Self {
            aabb: self.aabb.transformed(&map.linear, translation),
            flux,
            area_flux: self.area_flux.min(flux),
            punctual_flux: self.punctual_flux.min(flux),
            mean: map.linear * self.mean + translation,
            variance: self.variance * map.mean_square_scale,
            axis: axis * self.axis.length(),
            cos_half_angle,
            range: self.range,
        }
    }
}

impl Default for Cluster {
    fn default() -> Self {
        Self::EMPTY
    }
}

/// What emits into the directions of a cap, which decides how a map changes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Emitters {
    /// The axis is best that of beams, which keep their angles about it. Surfaces may be among them.
    Beams,
    /// The axis is best that of surfaces, and lights without size are among them.
    Mixed,
    /// Surfaces alone, each of which emits to a half space.
    Surfaces,
}

impl Emitters {
    /// Whose lights have these fluxes. `has_normal` says whether the axis is best that of surfaces.
    #[inline(always)]
    pub fn of(punctual: f32, area: f32, has_normal: bool) -> Self {
        match has_normal {
            false => Self::Beams,
            true if punctual <= 0.0 && area > 0.0 => Self::Surfaces,
            true => Self::Mixed,
        }
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
    /// The least singular value. 0 if `linear` is singular or has an entry that is not finite.
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
        let (least_scale, turn) = if is_similarity {
            (mean_square_scale.sqrt() * (1.0 - SIMILARITY_TOLERANCE), Vec2::X)
        } else if !is_invertible {
            (0.0, Vec2::NEG_X)
        } else {
            let (greatest, inverse) = (greatest_scale(&exact), greatest_scale(&exact.inverse()));
            ((1.0 / inverse) as f32, greatest_turn(greatest * inverse * (1.0 + SCALE_MARGIN)))
        };
        Self { linear, cofactor, determinant, is_similarity, turn, mean_square_scale, least_scale }
    }

    /// The image of a cap of directions: its unit axis, and the cosine of its half-angle, which is -1
    /// if the cap becomes all directions. `axis` has unit length or is zero.
    ///
    /// Half spaces of surfaces stay half spaces, and caps of lights without size are widened by
    /// [`Self::turn`] (docs/math.md, Caps under a map).
    #[inline(always)]
    pub(crate) fn cap(&self, emitters: Emitters, axis: Vec3, cos: f32) -> (Vec3, f32) {
        let image = if emitters == Emitters::Beams { self.linear } else { self.cofactor } * axis;
        let cos = match emitters {
            _ if self.is_similarity => cos,
            Emitters::Mixed => -1.0,
            Emitters::Beams if cos <= -self.turn.x => -1.0,
            Emitters::Beams => cos * self.turn.x - (1.0 - cos * cos).max(0.0).sqrt() * self.turn.y,
            // The greatest factor of areas over that of the axis. `max` turns NaN, which singular matrices
            // make, into -1.
            Emitters::Surfaces => {
                let greatest = self.determinant.abs() / (self.least_scale * image.length());
                ((cos.min(0.0) - AXIS_ROUNDING) * greatest).max(-1.0)
            }
        };
        (image.normalize_or_zero(), cos)
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

    /// The lengths of the images of the axes.
    pub(crate) fn axis_scales(&self) -> Vec3 {
        Vec3::new(self.linear.x_axis.length(), self.linear.y_axis.length(), self.linear.z_axis.length())
    }

    /// The mean factor of areas over all normals.
    pub(crate) fn mean_area_scale(&self) -> f32 {
        (self.cofactor.to_cols_array().iter().map(|e| e * e).sum::<f32>() / 3.0).sqrt()
    }
}

/// Cosine and sine of the greatest angle by which a matrix turns two directions against each other,
/// at most half a turn, for the greatest by the least singular value κ.
///
/// The angle is 4 atan(√κ) − π (docs/math.md, Caps under a map).
fn greatest_turn(condition: f64) -> Vec2 {
    let angle = 4.0 * condition.sqrt().atan() - std::f64::consts::PI;
    // A cosine of 1 stands for a similarity.
    let cos = (angle.cos() as f32).min(1.0 - 0.5 * f32::EPSILON);
    if angle < MAX_TURN { Vec2::new(cos, angle.sin() as f32) } else { Vec2::NEG_X }
}

/// The greatest singular value of a matrix.
///
/// Source: Smith, Eigenvalues of a symmetric 3 × 3 matrix (1961), for the Gram matrix.
fn greatest_scale(matrix: &DMat3) -> f64 {
    let gram = matrix.transpose() * *matrix;
    let mean = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    let rest = gram - DMat3::from_diagonal(DVec3::splat(mean));
    let size = (rest.to_cols_array().iter().map(|e| e * e).sum::<f64>() / 6.0).sqrt();
    // 0 for a similarity, of which no digit of the rest means anything.
    let angle = if size > 0.0 { (0.5 * (rest * size.recip()).determinant()).clamp(-1.0, 1.0).acos() } else { 0.0 };
    (mean + 2.0 * size * (angle / 3.0).cos()).sqrt()
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

    fn unit(k: f32) -> Vec3 {
        Vec3::new((3.1 * k).sin(), (1.7 * k).cos(), (2.3 * k + 1.0).sin()).normalize()
    }

    /// Rotated, stretched and mirrored maps with their exact singular values, which are up to `most`
    /// apart.
    fn maps(most: f32) -> impl Iterator<Item = (Linear, [f64; 3])> {
        (0..600).map(move |i| {
            let k = i as f32;
            let squash = most.powf((i % 13) as f32 / 12.0);
            let middle = [1.0, squash.sqrt(), squash][i % 3];
            let scales = Vec3::new(1.0, middle, squash) / squash.sqrt();
            let mirror = if i % 2 == 0 { 1.0 } else { -1.0 };
            let turn = |k: f32| Mat3::from_axis_angle(unit(k), 5.0 * k);
            let linear = turn(k) * Mat3::from_diagonal(scales * mirror) * turn(0.37 * k + 0.1);
            (Linear::new(linear), scales.as_dvec3().to_array())
        })
    }

    #[test]
    fn turns_and_least_scales_bound_those_of_the_matrix_and_are_nearly_exact() {
        let turn_of = |map: &Linear| f64::from(map.turn.y).atan2(f64::from(map.turn.x));
        for (map, [least, _, greatest]) in maps(1.0e6) {
            // The rounding of a matrix moves its least scale by up to 1e-7 of its greatest one.
            let (condition, error) = (greatest / least, 2.0e-7 * greatest / least + 1.2e-5);
            assert!((f64::from(map.least_scale) / least - 1.0).abs() < error, "{least}: {}", map.least_scale);
            // The directions of the greatest turn lie to both sides of the axis that shrinks least.
            let expected = 2.0 * (condition.sqrt().atan() - condition.sqrt().recip().atan());
            let expected = if expected < MAX_TURN { expected } else { std::f64::consts::PI };
            assert!((turn_of(&map) - expected).abs() < error + 4.0e-4, "{condition}: {} {expected}", turn_of(&map));
            let exact = map.linear.as_dmat3();
            for i in 0..50 {
                let (a, b) = (unit(i as f32).as_dvec3(), unit(1.37 * i as f32 + 0.2).as_dvec3());
                assert!((exact * a).length() >= f64::from(map.least_scale) * (1.0 - 1.0e-7));
                let turned = (exact * a).angle_between(exact * b) - a.angle_between(b);
                assert!(turned.abs() <= turn_of(&map) + 1.0e-5, "{condition}: {turned} of {}", turn_of(&map));
            }
        }
        for scale in [1.0e-8, 1.0, 1.0e8] {
            let map = Linear::new(Mat3::from_rotation_y(2.0) * scale);
            assert!(map.turn == Vec2::X && (map.least_scale / scale - 1.0).abs() < 2.0e-5, "{scale}");
        }
    }

    /// Directions within a cap about a unit axis: on its rim, and inside.
    fn within(axis: Vec3, half_angle: f64) -> impl Iterator<Item = DVec3> {
        let (axis, across) = (axis.as_dvec3(), axis.any_orthonormal_vector().as_dvec3());
        (0..90).map(move |k| {
            let (angle, around) = (half_angle * [1.0, 1.0, 0.6][k % 3], 0.07 * k as f64);
            let side = across * around.cos() + axis.cross(across) * around.sin();
            axis * angle.cos() + side * angle.sin()
        })
    }

    /// Half spaces turn with their normals, and beams keep their angles about images of their axes.
    #[test]
    fn images_of_caps_hold_what_surfaces_and_beams_emit() {
        let (mut caps, mut held) = (0, 0);
        for (i, (map, _)) in maps(1.0e9).enumerate() {
            let (axis, exact) = (unit(0.77 * i as f32), map.linear.as_dmat3());
            let normals = exact.inverse().transpose();
            // Callers have a margin of 1e-3 rad.
            let mut check = |image: Vec3, cos: f32, direction: DVec3| {
                let beyond = direction.angle_between(image.as_dvec3()) - f64::from(cos).acos();
                assert!(beyond < 1.0e-3, "{i}: {beyond} of {cos}");
                held += 1;
            };
            for half_angle in [1.0e-3_f64, 0.1, 0.7, 1.57, 1.58, 1.8, 2.6, 3.1] {
                for emitters in [Emitters::Beams, Emitters::Mixed] {
                    let (image, cos) = map.cap(emitters, axis, half_angle.cos() as f32);
                    if cos <= -1.0 {
                        continue;
                    }
                    caps += 1;
                    for beam in [0.0, 0.3 * half_angle, half_angle] {
                        for to in within(axis, half_angle - beam) {
                            let turned = (exact * to).normalize();
                            within(turned.as_vec3(), beam).for_each(|direction| check(image, cos, direction));
                        }
                    }
                }
                // Surfaces emit into half spaces, whose normals are within the cap less a right angle.
                let spread = half_angle - std::f64::consts::FRAC_PI_2;
                if spread < 0.0 {
                    continue;
                }
                for emitters in [Emitters::Beams, Emitters::Mixed, Emitters::Surfaces] {
                    let (image, cos) = map.cap(emitters, axis, half_angle.cos() as f32);
                    for normal in within(axis, spread).filter(|_| cos > -1.0) {
                        caps += 1;
                        let turned = (normals * normal).normalize();
                        within(turned.as_vec3(), 1.57).for_each(|direction| check(image, cos, direction));
                    }
                }
            }
        }
        assert!(caps > 2000 && held > 1_000_000, "{caps} {held}");
    }

    #[test]
    fn half_spaces_stay_half_spaces_and_spreads_of_normals_widen_no_more_than_they_must() {
        for (map, scales) in maps(1.0e4) {
            let (image, cos) = map.cap(Emitters::Surfaces, Vec3::Y, 0.0);
            let normal = map.cofactor.as_dmat3() * DVec3::Y;
            let least = -1.1 * f64::from(AXIS_ROUNDING) * scales[2] / scales[0];
            assert!(f64::from(cos) >= least && cos <= 0.0, "{cos}");
            assert!(image.as_dvec3().distance(normal.normalize()) < 1.0e-3);
        }
        // Normals spread where areas shrink, and not elsewhere.
        let map = Linear::new(Mat3::from_diagonal(Vec3::new(1.0, 3.0, 1.0)));
        for (axis, ratio) in [(Vec3::Y, 3.0), (Vec3::X, 1.0)] {
            let (_, cos) = map.cap(Emitters::Surfaces, axis, -0.01);
            assert!((cos / -(0.01 + AXIS_ROUNDING) - ratio).abs() < 1.0e-4, "{axis}: {cos}");
        }
    }

    #[test]
    fn caps_of_beams_widen_by_the_turn_and_stay_as_they_are_under_similarities() {
        let map = Linear::new(Mat3::from_diagonal(Vec3::new(1.0, 1.1, 1.0)));
        let turn = map.turn.y.atan2(map.turn.x);
        assert!(turn > 0.09 && turn < 0.1, "{turn}");
        for half_angle in [0.0_f32, 0.1, 1.0, 2.0, 3.0] {
            let (axis, cos) = map.cap(Emitters::Beams, Vec3::X, half_angle.cos());
            assert!(axis == Vec3::X && (cos.acos() - half_angle - turn).abs() < 1.0e-3, "{half_angle}");
            let similar = Linear::new(Mat3::from_diagonal(Vec3::splat(-7.0)));
            assert_eq!(similar.cap(Emitters::Beams, Vec3::X, half_angle.cos()), (-Vec3::X, half_angle.cos()));
        }
        assert_eq!(map.cap(Emitters::Beams, Vec3::X, (std::f32::consts::PI - 0.9 * turn).cos()).1, -1.0);
        let squashed = Linear::new(Mat3::from_diagonal(Vec3::new(1.0e-4, 1.0, 1.0)));
        assert_eq!(squashed.cap(Emitters::Beams, Vec3::X, 1.0).1, -1.0);
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

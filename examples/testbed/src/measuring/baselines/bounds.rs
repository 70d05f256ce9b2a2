//! The bounds that both published trees keep of a group of lights: a box, a cone of normals, an
//! emission angle and a power.
//!
//! Source: Conty Estevez and Kulla, Importance Sampling of Many Lights with Adaptive Tree Splitting
//! (2018), 4.1; the two-sided flag is from Pharr, Jakob and Humphreys, Physically Based Rendering
//! (4th edition), 12.6.3.

use crate::measuring::emitter::{Emitter, Form, RealAabb};
use crate::measuring::real::{Real, Vector};

/// Added to the emission angle of a spot, in radians, so that a falloff without width does not
/// round to no emission at all.
const SPOT_RIM: f64 = 1.0e-3;

/// Bounds of lights.
#[derive(Clone, Copy, Debug)]
pub struct LightBounds<R: Real = f32> {
    pub aabb: RealAabb<R>,
    /// The axis of the cone of normals, a unit vector.
    pub axis: R::Vec3,
    /// The half-angle of the cone of normals, in radians.
    pub theta_o: R,
    /// The angle up to which each light emits, measured from its normal, in radians.
    pub theta_e: R,
    /// Lumens or candela, depending on the formula.
    pub power: R,
    /// Lights emit to both sides of their normals.
    pub is_two_sided: bool,
}

impl<R: Real> LightBounds<R> {
    /// Bounds of a light with normals in all directions: a point or a sphere.
    pub fn all_round(light: &Emitter<R>, power: R) -> Self {
        Self { theta_o: R::PI(), theta_e: R::FRAC_PI_2(), ..Self::about(light, R::Vec3::Z, power) }
    }

    /// Bounds of a spot with full emission within `inner` and none beyond `outer` radians. Both
    /// formulas weight emission by a cosine, so the part beyond a right angle counts as normals.
    pub fn spot(light: &Emitter<R>, direction: R::Vec3, [inner, outer]: [R; 2], power: R) -> Self {
        let rim = R::of(SPOT_RIM);
        let theta_e = (outer - inner + rim).min(R::FRAC_PI_2());
        let theta_o = (outer + rim - theta_e).min(R::PI());
        Self { theta_o, theta_e, ..Self::about(light, direction.normalize_or(R::Vec3::Z), power) }
    }

    /// Bounds of a flat Lambertian emitter; one-sided, unless the caller changes that.
    pub fn flat(light: &Emitter<R>, power: R) -> Self {
        Self { theta_e: R::FRAC_PI_2(), ..Self::about(light, normal(light), power) }
    }

    fn about(light: &Emitter<R>, axis: R::Vec3, power: R) -> Self {
        Self { aabb: light.aabb(), axis, theta_o: R::zero(), theta_e: R::zero(), power, is_two_sided: false }
    }

    /// Bounds of both groups.
    pub fn union(&self, other: &Self) -> Self {
        let (axis, theta_o) = union_cone((self.axis, self.theta_o), (other.axis, other.theta_o));
        Self {
            aabb: self.aabb.union(&other.aabb),
            axis,
            theta_o,
            theta_e: self.theta_e.max(other.theta_e),
            power: self.power + other.power,
            is_two_sided: self.is_two_sided || other.is_two_sided,
        }
    }
}

/// The front normal of a flat light.
fn normal<R: Real>(light: &Emitter<R>) -> R::Vec3 {
    match light.form {
        Form::Rectangle { half_u, half_v, .. } => half_u.cross(half_v),
        Form::Triangle { vertices: [a, b, c], .. } => (b - a).cross(c - a),
        _ => R::Vec3::Z,
    }
    .normalize_or(R::Vec3::Z)
}

/// The smallest cone around two cones. Opposite axes give all directions.
fn union_cone<R: Real>(a: (R::Vec3, R), b: (R::Vec3, R)) -> (R::Vec3, R) {
    let (a, b) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    let between = R::of(2.0) * (a.0 - b.0).length().atan2((a.0 + b.0).length());
    if (between + b.1).min(R::PI()) <= a.1 {
        return a;
    }
    let theta = R::of(0.5) * (a.1 + between + b.1);
    let turn = a.0.cross(b.0).try_normalize();
    match turn {
        Some(turn) if theta < R::PI() => (a.0.turned(turn, theta - a.1).normalize(), theta),
        // Except for rounding, equal axes mean that one cone contains the other. Opposite axes have
        // no plane to turn in.
        None if between < R::one() => (a.0, theta),
        _ => (a.0, R::PI()),
    }
}

//! The bounds that both published trees keep of a group of lights: a box, a cone of normals, an
//! emission angle and a power.
//!
//! Source: Conty Estevez and Kulla, Importance Sampling of Many Lights with Adaptive Tree Splitting
//! (2018), 4.1; the two-sided flag is from Pharr, Jakob and Humphreys, Physically Based Rendering
//! (4th edition), 12.6.3.

use girandole::bounds::Aabb;
use girandole::glam::{Quat, Vec3};
use girandole::{Light, Shape};
use std::f32::consts::PI;

/// Added to the emission angle of a spot, in radians, so that a falloff without width does not
/// round to no emission at all.
const SPOT_RIM: f32 = 1.0e-3;

/// Bounds of lights.
#[derive(Clone, Copy, Debug)]
pub struct LightBounds {
    pub aabb: Aabb,
    /// The axis of the cone of normals, a unit vector.
    pub axis: Vec3,
    /// The half-angle of the cone of normals, in radians.
    pub theta_o: f32,
    /// The angle up to which each light emits, measured from its normal, in radians.
    pub theta_e: f32,
    /// Lumens or candela, depending on the formula.
    pub power: f32,
    /// Lights emit to both sides of their normals.
    pub is_two_sided: bool,
}

impl LightBounds {
    /// Bounds of a light with normals in all directions: a point or a sphere.
    pub fn all_round(light: &Light, power: f32) -> Self {
        Self { axis: Vec3::Z, theta_o: PI, theta_e: 0.5 * PI, ..Self::about(light, Vec3::Z, power) }
    }

    /// Bounds of a spot with full emission within `inner` and none beyond `outer` radians. Both
    /// formulas weight emission by a cosine, so the part beyond a right angle counts as normals.
    pub fn spot(light: &Light, direction: Vec3, [inner, outer]: [f32; 2], power: f32) -> Self {
        let theta_e = (outer - inner + SPOT_RIM).min(0.5 * PI);
        let theta_o = (outer + SPOT_RIM - theta_e).min(PI);
        Self { theta_o, theta_e, ..Self::about(light, direction.normalize_or(Vec3::Z), power) }
    }

    /// Bounds of a flat Lambertian emitter; one-sided, unless the caller changes that.
    pub fn flat(light: &Light, power: f32) -> Self {
        Self { theta_e: 0.5 * PI, ..Self::about(light, normal(light), power) }
    }

    fn about(light: &Light, axis: Vec3, power: f32) -> Self {
        Self { aabb: light.aabb(), axis, theta_o: 0.0, theta_e: 0.0, power, is_two_sided: false }
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
fn normal(light: &Light) -> Vec3 {
    match light.shape {
        Shape::Rectangle { half_u, half_v, .. } => half_u.cross(half_v),
        Shape::Triangle { vertices: [a, b, c], .. } => (b - a).cross(c - a),
        _ => Vec3::Z,
    }
    .normalize_or(Vec3::Z)
}

/// The smallest cone around two cones. Opposite axes give all directions.
fn union_cone(a: (Vec3, f32), b: (Vec3, f32)) -> (Vec3, f32) {
    let (a, b) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    let between = 2.0 * (a.0 - b.0).length().atan2((a.0 + b.0).length());
    if (between + b.1).min(PI) <= a.1 {
        return a;
    }
    let theta = 0.5 * (a.1 + between + b.1);
    let turn = a.0.cross(b.0).try_normalize();
    match turn {
        Some(turn) if theta < PI => ((Quat::from_axis_angle(turn, theta - a.1) * a.0).normalize(), theta),
        // Except for rounding, equal axes mean that one cone contains the other. Opposite axes have
        // no plane to turn in.
        None if between < 1.0 => (a.0, theta),
        _ => (a.0, PI),
    }
}

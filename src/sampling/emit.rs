//! Samples a point on a chosen light: its direction, its radiance, and the density of the
//! direction.
//!
//! Twin of `shaders/emit.wgsl`. Everything is computed in the world, so that flattened, sheared and
//! mirrored instances are exact. A sphere is the exception: it is sampled in its tree's space,
//! where it is round.

use std::f32::consts::PI;

use glam::{Quat, Vec3};

use crate::instance::transform::InstanceTransform;
use crate::light::{Light, Shape, range_window, spot_falloff};
use crate::math::dice::clamp_unit;
use crate::math::solid_angle::NearSurface;
use crate::shading::segment::LocalSegment;
use crate::shading::shading_point::ShadingPoint;
use crate::sky::SKY_DIST;

/// The light that arrives at a shading point from a point on a light, not yet shadowed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Incident {
    /// Unit vector from the shading point to the point on the light.
    pub direction: Vec3,
    /// Distance to the point in metres; infinity for a directional light and for the sky.
    pub dist: f32,
    /// Radiance in nits for surfaces. For points, spots and directional lights the illuminance, in
    /// lux, of a surface that faces them.
    pub radiance: Vec3,
    /// Density of the direction per steradian for surfaces; 1 for points, spots and directional
    /// lights.
    pub pdf: f32,
    /// True for lights without size: rays cannot hit them, and `pdf` is no density of directions.
    pub is_delta: bool,
    /// For a segment, the distance in metres from its start to the point at which the light
    /// arrives: the other fields are as seen from there, and `pdf` is multiplied by the density per
    /// metre of that distance. 0 for a point.
    pub along: f32,
}

impl Incident {
    /// From the shading point, or the middle of its segment, to the point on the light.
    pub(crate) fn toward(&self, segment: Option<&LocalSegment>) -> Vec3 {
        let start = segment.map_or(Vec3::ZERO, |segment| segment.unit * (self.along - segment.half));
        start + self.direction * self.dist.min(SKY_DIST)
    }
}

/// The squared distance, in square metres, below which a point on a light counts as sending
/// nothing. On the light itself the illuminance is infinite; from this distance on that of the
/// brightest lamp fits into f32.
pub(crate) const MIN_DIST_SQ: f32 = 1.0e-22;

/// The least density per steradian. Densities outside [`MIN_PDF`, 1 / `MIN_INVERSE_PDF`] occur
/// where a surface is seen from its edge or touched; quotients with them would leave f32.
pub(crate) const MIN_PDF: f32 = 1.0e-36;
/// See [`MIN_PDF`].
pub(crate) const MIN_INVERSE_PDF: f32 = 1.0e-30;

/// A share of the distance to a sphere's centre. If the sphere's surface is nearer than that,
/// differences of positions lose digits.
pub(crate) const CLOSE: f32 = 0.1;

/// Samples a point on a light. `None` if that point sends nothing to the shading point, because it
/// faces away, is out of range, or lies behind the shading point's surface.
///
/// Flat surfaces are sampled uniformly by area, spheres uniformly by the solid angle that they
/// subtend (PBRT4 6.2.4). With `by_solid_angle`, so are flat surfaces that are large or near
/// (`solid_angle.rs`). Numbers of `u` outside [0, 1) are clamped, and NaN counts as 0.
pub(crate) fn sample_light(
    light: &Light,
    frame: &InstanceTransform,
    shading_point: &ShadingPoint,
    by_solid_angle: bool,
    u: [f32; 2],
) -> Option<Incident> {
    // A light whose flux rounds to 0 has the probability 0 as well.
    (light.flux() > 0.0).then_some(())?;
    let u = u.map(clamp_unit);
    match light.shape {
        Shape::Point { position } => from_delta(light, frame.toward(position, shading_point), 1.0, shading_point),
        Shape::Spot { position, direction, inner_angle, outer_angle } => {
            let toward = frame.toward(position, shading_point);
            let axis = (frame.to_world * direction).normalize_or_zero();
            let cos = -axis.dot(toward.normalize_or_zero());
            let (scale, offset) = spot_falloff(inner_angle, outer_angle);
            let falloff = (cos * scale + offset).clamp(0.0, 1.0);
            from_delta(light, toward, falloff * falloff, shading_point)
        }
        Shape::Profile { position, rotation, profile } => {
            let toward = frame.toward(position, shading_point);
            let in_lamp = Quat::from_array(rotation).conjugate() * (frame.to_local * -toward);
            from_delta(light, toward, profile.candela(in_lamp), shading_point)
        }
        Shape::Rectangle { center, half_u, half_v, two_sided } => {
            let (a, b) = (frame.to_world * half_u, frame.to_world * half_v);
            let to_center = frame.toward(center, shading_point);
            let normal_area = frame.normal_area(half_u.cross(half_v) * 4.0);
            if let Some(near) = by_solid_angle.then(|| NearSurface::parallelogram(to_center, a, b)).flatten() {
                let is_lit = is_lit_side(to_center, normal_area, two_sided);
                return is_lit.then(|| from_near_surface(light, &near, shading_point, u)).flatten();
            }
            let toward = to_center + a * (2.0 * u[0] - 1.0) + b * (2.0 * u[1] - 1.0);
            from_surface(light, toward, normal_area, two_sided, shading_point)
        }
        Shape::Triangle { vertices, two_sided } => {
            let [p, q, r] = vertices;
            let (a, b) = (frame.to_world * (q - p), frame.to_world * (r - p));
            let to_corner = frame.toward(p, shading_point);
            let normal_area = frame.normal_area((q - p).cross(r - p) * 0.5);
            if let Some(near) = by_solid_angle.then(|| NearSurface::triangle(to_corner, a, b)).flatten() {
                let is_lit = is_lit_side(to_corner, normal_area, two_sided);
                return is_lit.then(|| from_near_surface(light, &near, shading_point, u)).flatten();
            }
            let root = u[0].sqrt();
            let toward = to_corner + a * (root * (1.0 - u[1])) + b * (root * u[1]);
            from_surface(light, toward, normal_area, two_sided, shading_point)
        }
        Shape::Sphere { center, radius } => from_sphere(light, center, radius, frame, shading_point, u),
    }
}

fn from_delta(light: &Light, toward: Vec3, falloff: f32, shading_point: &ShadingPoint) -> Option<Incident> {
    let dist_sq = toward.length_squared();
    let share = falloff * range_window(dist_sq, light.range) / dist_sq;
    let dist = dist_sq.sqrt();
    (dist_sq >= MIN_DIST_SQ && share > 0.0).then_some(())?;
    arriving(shading_point, toward / dist, dist, light.emission * share, 1.0, true)
}

/// `normal_area` is the normal of the front times the area.
fn from_surface(
    light: &Light,
    toward: Vec3,
    normal_area: Vec3,
    two_sided: bool,
    shading_point: &ShadingPoint,
) -> Option<Incident> {
    let dist_sq = toward.length_squared();
    let dist = dist_sq.sqrt();
    let direction = toward / dist;
    let mut facing_area = -normal_area.dot(direction);
    if two_sided {
        facing_area = facing_area.abs();
    }
    (dist_sq >= MIN_DIST_SQ && facing_area > 0.0 && is_density(dist_sq, facing_area)).then_some(())?;
    let radiance = light.emission * range_window(dist_sq, light.range);
    arriving(shading_point, direction, dist, radiance, dist_sq / facing_area, false)
}

/// Whether a flat surface emits to the side of the shading point. `to_plane` is the vector from the
/// shading point to any point of it.
pub(crate) fn is_lit_side(to_plane: Vec3, normal_area: Vec3, two_sided: bool) -> bool {
    two_sided || normal_area.dot(to_plane) < 0.0
}

/// From a surface that is sampled by solid angle and emits to the side of the shading point.
fn from_near_surface(light: &Light, near: &NearSurface, shading_point: &ShadingPoint, u: [f32; 2]) -> Option<Incident> {
    let toward = near.sample(u);
    let dist_sq = toward.length_squared();
    (dist_sq >= MIN_DIST_SQ).then_some(())?;
    let dist = dist_sq.sqrt();
    let radiance = light.emission * range_window(dist_sq, light.range);
    arriving(shading_point, toward / dist, dist, radiance, 1.0 / near.solid_angle(), false)
}

/// Whether a quotient is a density inside the limits that [`MIN_PDF`] describes.
pub(crate) fn is_density(dividend: f32, divisor: f32) -> bool {
    divisor >= dividend * MIN_INVERSE_PDF && dividend >= divisor * MIN_PDF
}

fn from_sphere(
    light: &Light,
    center: Vec3,
    radius: f32,
    frame: &InstanceTransform,
    shading_point: &ShadingPoint,
    u: [f32; 2],
) -> Option<Incident> {
    // Transforms the vector to the centre: local coordinates of a far shading point would cancel.
    let world_center = frame.toward(center, shading_point);
    let to_center = frame.to_local * world_center;
    let dist_sq = to_center.length_squared();
    let sin_max_sq = radius * radius / dist_sq;
    // A sphere emits outward: inside of it nothing arrives.
    (dist_sq >= f32::MIN_POSITIVE && sin_max_sq < 1.0).then_some(())?;
    let to_center_length = dist_sq.sqrt();
    let cos_max = (1.0 - sin_max_sq).sqrt();
    let one_minus_cos_max = sin_max_sq / (1.0 + cos_max);
    let one_minus_cos = u[0] * one_minus_cos_max;
    let cos = 1.0 - one_minus_cos;
    let sin_sq = (one_minus_cos * (2.0 - one_minus_cos)).clamp(0.0, sin_max_sq);
    let axis = to_center / to_center_length;
    let side = axis.any_orthonormal_vector();
    let (sin_phi, cos_phi) = (2.0 * PI * u[1]).sin_cos();
    let around = side * cos_phi + axis.cross(side) * sin_phi;
    // The distance along the ray is the smaller root of a quadratic, computed from the product of
    // both roots.
    let root = if sin_max_sq > 0.0 { (1.0 - sin_sq / sin_max_sq).sqrt() } else { 0.0 };
    let hit = (to_center_length - radius) * (to_center_length + radius) / (to_center_length * cos + radius * root);
    let (toward, stretch) = if hit > CLOSE * to_center_length {
        // The direction goes through the point that is hit, which lies on the sphere however flat
        // the instance makes it. A direction that is transformed out of a squeezed space may miss
        // the sphere.
        let cos_normal = (sin_sq / sin_max_sq.sqrt() + cos * root).min(1.0);
        let normal = around * (1.0 - cos_normal * cos_normal).sqrt() - axis * cos_normal;
        let toward = world_center + frame.to_world * (normal * radius);
        (toward, toward.length() / hit)
    } else {
        // The sphere is so close that the difference of the two points would cancel.
        let world = frame.to_world * (axis * cos + around * sin_sq.sqrt());
        (world * hit, world.length())
    };
    let dist_sq = toward.length_squared();
    let dist = dist_sq.sqrt();
    // A solid angle in the sphere's space times |det| / stretch^3 is that in the world.
    let (cubed, solid_angle) = (stretch * stretch * stretch, 2.0 * PI * one_minus_cos_max * frame.determinant.abs());
    let is_lit = solid_angle >= f32::MIN_POSITIVE && hit > 0.0 && dist_sq >= MIN_DIST_SQ;
    (is_lit && is_density(cubed, solid_angle)).then_some(())?;
    let radiance = light.emission * range_window(dist_sq, light.range);
    arriving(shading_point, toward / dist, dist, radiance, cubed / solid_angle, false)
}

fn arriving(
    shading_point: &ShadingPoint,
    direction: Vec3,
    dist: f32,
    radiance: Vec3,
    pdf: f32,
    is_delta: bool,
) -> Option<Incident> {
    let is_above = shading_point.normal == Vec3::ZERO || shading_point.normal.dot(direction) > 0.0;
    (is_above && radiance != Vec3::ZERO && direction.is_finite()).then_some(Incident {
        direction,
        dist,
        radiance,
        pdf,
        is_delta,
        along: 0.0,
    })
}

//! From a chosen light to the light that arrives: a point on it, its radiance, and the density of that choice.
//!
//! Twin of `shaders/emit.wgsl`. Everything is computed in the world, so that flattened, sheared and mirrored
//! instances are exact; a sphere is sampled in its own space, where it is round.

use std::f32::consts::PI;

use glam::{Mat3, Vec3};

use crate::importance::Receiver;
use crate::light::{Light, Shape, range_window, spot_falloff};

/// Light that arrives at a receiver, not yet shadowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incident {
    /// Unit vector from the receiver to the light.
    pub direction: Vec3,
    /// Metres; infinity for a directional light.
    pub distance: f32,
    /// Nits for surfaces; for points, spots and directional lights the illuminance in lux of a surface that faces them.
    pub radiance: Vec3,
    /// Per steradian for surfaces; 1 for points, spots and directional lights.
    pub pdf: f32,
    /// A light without size: there is nothing to hit, and `pdf` is no density.
    pub is_delta: bool,
}

/// How an instance places its lights: to the world (relative to its origin) and back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    pub to_world: Mat3,
    pub translation: Vec3,
    pub to_local: Mat3,
    pub determinant: f32,
}

impl Frame {
    fn point(&self, p: Vec3) -> Vec3 {
        self.to_world * p + self.translation
    }
}

/// Samples a point of a light. `None` if that point sends nothing to the receiver: it faces away, is out of range, or
/// lies behind the receiver's surface.
///
/// Surfaces are sampled evenly over their area, spheres over the solid angle that they cover (PBRT4 6.2.4).
pub(crate) fn sample_light(light: &Light, frame: &Frame, receiver: &Receiver, u: [f32; 2]) -> Option<Incident> {
    match light.shape {
        Shape::Point { position } => delta(light, frame.point(position), 1.0, receiver),
        Shape::Spot { position, direction, inner_angle, outer_angle } => {
            let at = frame.point(position);
            let axis = (frame.to_world * direction).normalize_or_zero();
            let cos = axis.dot((receiver.position - at).normalize_or_zero());
            let (scale, offset) = spot_falloff(inner_angle, outer_angle);
            let falloff = (cos * scale + offset).clamp(0.0, 1.0);
            delta(light, at, falloff * falloff, receiver)
        }
        Shape::Rectangle { center, half_u, half_v, two_sided } => {
            let (a, b) = (frame.to_world * half_u, frame.to_world * half_v);
            let at = frame.point(center) + a * (2.0 * u[0] - 1.0) + b * (2.0 * u[1] - 1.0);
            surface(light, at, a.cross(b) * 4.0 * frame.determinant.signum(), two_sided, receiver)
        }
        Shape::Triangle { vertices, two_sided } => {
            let [p, q, r] = vertices.map(|v| frame.point(v));
            let root = u[0].sqrt();
            let at = p + (q - p) * (root * (1.0 - u[1])) + (r - p) * (root * u[1]);
            surface(light, at, (q - p).cross(r - p) * 0.5 * frame.determinant.signum(), two_sided, receiver)
        }
        Shape::Sphere { center, radius } => sphere(light, center, radius, frame, receiver, u),
    }
}

fn delta(light: &Light, at: Vec3, falloff: f32, receiver: &Receiver) -> Option<Incident> {
    let toward = at - receiver.position;
    let dist_sq = toward.length_squared();
    let share = falloff * range_window(dist_sq, light.range) / dist_sq;
    let distance = dist_sq.sqrt();
    // A receiver on the light itself gets infinitely much: no number can say that, so it counts as nothing.
    (dist_sq >= f32::MIN_POSITIVE && share > 0.0 && share.is_finite()).then_some(())?;
    arriving(receiver, toward / distance, distance, light.emission * share, 1.0, true)
}

/// `normal_area` is the front normal times the area.
fn surface(light: &Light, at: Vec3, normal_area: Vec3, two_sided: bool, receiver: &Receiver) -> Option<Incident> {
    let toward = at - receiver.position;
    let dist_sq = toward.length_squared();
    let distance = dist_sq.sqrt();
    let direction = toward / distance;
    let mut facing_area = -normal_area.dot(direction);
    if two_sided {
        facing_area = facing_area.abs();
    }
    let pdf = dist_sq / facing_area;
    (facing_area > 0.0 && pdf > 0.0 && pdf.is_finite()).then_some(())?;
    arriving(receiver, direction, distance, light.emission * range_window(dist_sq, light.range), pdf, false)
}

fn sphere(
    light: &Light,
    center: Vec3,
    radius: f32,
    frame: &Frame,
    receiver: &Receiver,
    u: [f32; 2],
) -> Option<Incident> {
    // Relative to the world position of the centre first: local coordinates of a far receiver would cancel.
    let to_center = frame.to_local * (frame.point(center) - receiver.position);
    let dist_sq = to_center.length_squared();
    let sin_max_sq = radius * radius / dist_sq;
    // From inside nothing is seen: a sphere emits outward.
    (sin_max_sq < 1.0).then_some(())?;
    let cos_max = (1.0 - sin_max_sq).sqrt();
    let one_minus_cos_max = sin_max_sq / (1.0 + cos_max);
    let one_minus_cos = u[0] * one_minus_cos_max;
    let cos = 1.0 - one_minus_cos;
    let sin_sq = one_minus_cos * (2.0 - one_minus_cos);
    let axis = to_center / dist_sq.sqrt();
    let side = axis.any_orthonormal_vector();
    let (sin_phi, cos_phi) = (2.0 * PI * u[1]).sin_cos();
    let local = axis * cos + (side * cos_phi + axis.cross(side) * sin_phi) * sin_sq.max(0.0).sqrt();
    let hit = dist_sq.sqrt() * cos - (radius * radius - dist_sq * sin_sq).max(0.0).sqrt();
    let world = frame.to_world * local;
    let stretch = world.length();
    let distance = hit * stretch;
    // A solid angle in the sphere's space is |det| / stretch^3 of it in the world.
    let pdf = stretch * stretch * stretch / (2.0 * PI * one_minus_cos_max * frame.determinant.abs());
    (pdf > 0.0 && pdf.is_finite() && distance > 0.0).then_some(())?;
    let window = range_window(distance * distance, light.range);
    arriving(receiver, world / stretch, distance, light.emission * window, pdf, false)
}

fn arriving(
    receiver: &Receiver,
    direction: Vec3,
    distance: f32,
    radiance: Vec3,
    pdf: f32,
    is_delta: bool,
) -> Option<Incident> {
    let above = receiver.normal == Vec3::ZERO || receiver.normal.dot(direction) > 0.0;
    (above && radiance != Vec3::ZERO && direction.is_finite()).then_some(Incident {
        direction,
        distance,
        radiance,
        pdf,
        is_delta,
    })
}

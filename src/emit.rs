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
    /// From a receiver to a place in tree space. The translations first: what is near each other far from the origin
    /// keeps its digits, and lies where the walk's bounds see it.
    pub fn toward(&self, p: Vec3, receiver: &Receiver) -> Vec3 {
        self.to_world * p + (self.translation - receiver.position)
    }

    /// A normal times an area, carried along by the cofactors. Not a cross product of carried edges: a sliver's would
    /// round to another side than its cap.
    pub fn normal_area(&self, normal_area: Vec3) -> Vec3 {
        self.to_local.transpose() * normal_area * self.determinant.abs()
    }
}

/// A receiver on the light itself gets infinitely much, which no number can say: nearer than this it counts as nothing.
/// Square metres; the brightest lamp stays inside f32.
pub(crate) const NEAREST_SQ: f32 = 1.0e-22;

/// Densities outside these, per steradian and its inverse, belong to surfaces seen from their edge or touched: their
/// quotients would leave f32.
pub(crate) const LEAST_PDF: f32 = 1.0e-36;
/// See [`LEAST_PDF`].
pub(crate) const LEAST_INVERSE_PDF: f32 = 1.0e-30;

/// Nearer to a sphere's surface than this share of the way to its centre, differences of positions lose digits.
pub(crate) const CLOSE: f32 = 0.1;

/// Samples a point of a light. `None` if that point sends nothing to the receiver: it faces away, is out of range, or
/// lies behind the receiver's surface.
///
/// Surfaces are sampled evenly over their area, spheres over the solid angle that they cover (PBRT4 6.2.4).
pub(crate) fn sample_light(light: &Light, frame: &Frame, receiver: &Receiver, u: [f32; 2]) -> Option<Incident> {
    // What rounds to no flux has no chance either.
    (light.flux() > 0.0).then_some(())?;
    match light.shape {
        Shape::Point { position } => delta(light, frame.toward(position, receiver), 1.0, receiver),
        Shape::Spot { position, direction, inner_angle, outer_angle } => {
            let toward = frame.toward(position, receiver);
            let axis = (frame.to_world * direction).normalize_or_zero();
            let cos = -axis.dot(toward.normalize_or_zero());
            let (scale, offset) = spot_falloff(inner_angle, outer_angle);
            let falloff = (cos * scale + offset).clamp(0.0, 1.0);
            delta(light, toward, falloff * falloff, receiver)
        }
        Shape::Rectangle { center, half_u, half_v, two_sided } => {
            let (a, b) = (frame.to_world * half_u, frame.to_world * half_v);
            let toward = frame.toward(center, receiver) + a * (2.0 * u[0] - 1.0) + b * (2.0 * u[1] - 1.0);
            surface(light, toward, frame.normal_area(half_u.cross(half_v) * 4.0), two_sided, receiver)
        }
        Shape::Triangle { vertices, two_sided } => {
            let [p, q, r] = vertices;
            let (a, b) = (frame.to_world * (q - p), frame.to_world * (r - p));
            let root = u[0].sqrt();
            let toward = frame.toward(p, receiver) + a * (root * (1.0 - u[1])) + b * (root * u[1]);
            surface(light, toward, frame.normal_area((q - p).cross(r - p) * 0.5), two_sided, receiver)
        }
        Shape::Sphere { center, radius } => sphere(light, center, radius, frame, receiver, u),
    }
}

fn delta(light: &Light, toward: Vec3, falloff: f32, receiver: &Receiver) -> Option<Incident> {
    let dist_sq = toward.length_squared();
    let share = falloff * range_window(dist_sq, light.range) / dist_sq;
    let distance = dist_sq.sqrt();
    (dist_sq >= NEAREST_SQ && share > 0.0).then_some(())?;
    arriving(receiver, toward / distance, distance, light.emission * share, 1.0, true)
}

/// `normal_area` is the front normal times the area.
fn surface(light: &Light, toward: Vec3, normal_area: Vec3, two_sided: bool, receiver: &Receiver) -> Option<Incident> {
    let dist_sq = toward.length_squared();
    let distance = dist_sq.sqrt();
    let direction = toward / distance;
    let mut facing_area = -normal_area.dot(direction);
    if two_sided {
        facing_area = facing_area.abs();
    }
    (dist_sq >= NEAREST_SQ && facing_area > 0.0 && is_density(dist_sq, facing_area)).then_some(())?;
    let radiance = light.emission * range_window(dist_sq, light.range);
    arriving(receiver, direction, distance, radiance, dist_sq / facing_area, false)
}

/// Whether a quotient is a density that f32 can work with.
pub(crate) fn is_density(dividend: f32, divisor: f32) -> bool {
    divisor >= dividend * LEAST_INVERSE_PDF && dividend >= divisor * LEAST_PDF
}

fn sphere(
    light: &Light,
    center: Vec3,
    radius: f32,
    frame: &Frame,
    receiver: &Receiver,
    u: [f32; 2],
) -> Option<Incident> {
    // From the world's direction to the centre: local coordinates of a far receiver would cancel.
    let world_center = frame.toward(center, receiver);
    let to_center = frame.to_local * world_center;
    let dist_sq = to_center.length_squared();
    let sin_max_sq = radius * radius / dist_sq;
    // From inside nothing is seen: a sphere emits outward.
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
    // How far along the ray the sphere is: the smaller root of a quadratic, by the product of both.
    let root = if sin_max_sq > 0.0 { (1.0 - sin_sq / sin_max_sq).sqrt() } else { 0.0 };
    let hit = (to_center_length - radius) * (to_center_length + radius) / (to_center_length * cos + radius * root);
    let (toward, stretch) = if hit > CLOSE * to_center_length {
        // Through the point that is hit, which lies on the sphere however flat the instance makes it: a direction
        // carried out of a squeezed space would not even point there.
        let cos_normal = (sin_sq / sin_max_sq.sqrt() + cos * root).min(1.0);
        let normal = around * (1.0 - cos_normal * cos_normal).sqrt() - axis * cos_normal;
        let toward = world_center + frame.to_world * (normal * radius);
        (toward, toward.length() / hit)
    } else {
        // So close that the point and the receiver would cancel.
        let world = frame.to_world * (axis * cos + around * sin_sq.sqrt());
        (world * hit, world.length())
    };
    let dist_sq = toward.length_squared();
    let distance = dist_sq.sqrt();
    // A solid angle in the sphere's space is |det| / stretch^3 of it in the world.
    let (cubed, solid_angle) = (stretch * stretch * stretch, 2.0 * PI * one_minus_cos_max * frame.determinant.abs());
    let is_lit = solid_angle >= f32::MIN_POSITIVE && hit > 0.0 && dist_sq >= NEAREST_SQ;
    (is_lit && is_density(cubed, solid_angle)).then_some(())?;
    let radiance = light.emission * range_window(dist_sq, light.range);
    arriving(receiver, toward / distance, distance, radiance, cubed / solid_angle, false)
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

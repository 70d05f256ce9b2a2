//! The density with which sampling chooses the direction to a point on a light that a ray hit.
//!
//! Twin of `shaders/pdf.wgsl`. The inverse of `emit.rs`: it computes the same densities from a
//! point instead of from random numbers.

use std::f32::consts::PI;

use glam::Vec3;

use crate::instance::transform::InstanceTransform;
use crate::keys::LightId;
use crate::light::{Light, Shape, range_window};
use crate::math::solid_angle::NearSurface;
use crate::sampling::emit::{CLOSE, MIN_DIST_SQ, is_density, is_lit_side};
use crate::sampling::sample::LightSampler;
use crate::shading::segment::LocalSegment;
use crate::shading::shading_point::ShadingPoint;

impl LightSampler<'_> {
    /// Returns the density with which [`LightSampler::sample`] chooses a light and the direction to
    /// `point`, for multiple importance sampling of rays that hit lights.
    ///
    /// The density is `pmf * pdf`, per steradian in the world. `point` lies on the light, in metres
    /// relative to the world's origin; this is not checked. For the sky it lies in the direction, at any distance. 0 where sampling would find nothing
    /// (behind a one-sided light, below the shading point's horizon, out of range, inside a
    /// sphere), for lights without size, and for a light that does not exist. Also 0 for a segment,
    /// of which a ray has only one point: call this for points. The cost is that of
    /// [`LightSampler::pmf`].
    pub fn pdf(&self, shading_point: &ShadingPoint, light: LightId, point: Vec3) -> f32 {
        let LightId::Local { instance, light: index } = light else { return 0.0 };
        if LocalSegment::of(shading_point).is_some() {
            return 0.0;
        }
        let Some(placed) = self.world.instance(instance) else { return 0.0 };
        if placed.is_sky {
            let toward = point - shading_point.position;
            let pdf = placed.shown().map_or(0.0, |shown| self.sky_pdf(shown, shading_point, index, toward));
            return if pdf > 0.0 { pdf * self.pmf(shading_point, light) } else { 0.0 };
        }
        let tree = self.world.tree(placed.tree);
        let Some(record) = tree.and_then(|tree| tree.lights().get(index as usize)) else { return 0.0 };
        let Some(frame) = placed.shown().map(|placed| placed.frame(self.world.home())) else { return 0.0 };
        let toward = point - shading_point.position;
        let pdf = point_pdf(record, &frame, shading_point, self.world.solid_angle_sampling(), toward);
        if pdf > 0.0 { pdf * self.pmf(shading_point, light) } else { 0.0 }
    }
}

/// The density per steradian of the direction to a point on a given light; 0 if sampling never
/// returns it. `toward` is the vector to the point.
pub(crate) fn point_pdf(
    light: &Light,
    frame: &InstanceTransform,
    shading_point: &ShadingPoint,
    by_solid_angle: bool,
    toward: Vec3,
) -> f32 {
    let dist_sq = toward.length_squared();
    let is_above = shading_point.normal == Vec3::ZERO || shading_point.normal.dot(toward) > 0.0;
    let is_in_range = dist_sq >= MIN_DIST_SQ && range_window(dist_sq, light.range) > 0.0;
    if !(is_above && is_in_range && light.flux() > 0.0) {
        return 0.0;
    }
    match light.shape {
        Shape::Point { .. } | Shape::Spot { .. } | Shape::Profile { .. } => 0.0,
        Shape::Rectangle { center, half_u, half_v, two_sided } => {
            let normal_area = frame.normal_area(half_u.cross(half_v) * 4.0);
            let to_center = frame.toward(center, shading_point);
            let near = || NearSurface::parallelogram(to_center, frame.to_world * half_u, frame.to_world * half_v);
            match by_solid_angle.then(near).flatten() {
                Some(near) => near_surface_pdf(&near, to_center, normal_area, two_sided),
                None => surface_pdf(to_center, normal_area, two_sided, dist_sq),
            }
        }
        Shape::Triangle { vertices: [p, q, r], two_sided } => {
            let normal_area = frame.normal_area((q - p).cross(r - p) * 0.5);
            let to_corner = frame.toward(p, shading_point);
            let near = || NearSurface::triangle(to_corner, frame.to_world * (q - p), frame.to_world * (r - p));
            match by_solid_angle.then(near).flatten() {
                Some(near) => near_surface_pdf(&near, to_corner, normal_area, two_sided),
                None => surface_pdf(to_corner, normal_area, two_sided, dist_sq),
            }
        }
        Shape::Sphere { center, radius } => sphere_pdf(center, radius, frame, shading_point, toward),
    }
}

/// `to_plane` is the vector from the shading point to any point of the surface. The distance from
/// the plane follows from it without the point that was hit, which has few digits far from the
/// origin.
fn surface_pdf(to_plane: Vec3, normal_area: Vec3, two_sided: bool, dist_sq: f32) -> f32 {
    let height_area = -normal_area.dot(to_plane);
    let facing_area = (if two_sided { height_area.abs() } else { height_area }) / dist_sq.sqrt();
    if facing_area > 0.0 && is_density(dist_sq, facing_area) { dist_sq / facing_area } else { 0.0 }
}

/// The same density for all points of a surface that is sampled by solid angle.
fn near_surface_pdf(near: &NearSurface, to_plane: Vec3, normal_area: Vec3, two_sided: bool) -> f32 {
    if is_lit_side(to_plane, normal_area, two_sided) { 1.0 / near.solid_angle() } else { 0.0 }
}

fn sphere_pdf(center: Vec3, radius: f32, frame: &InstanceTransform, shading_point: &ShadingPoint, toward: Vec3) -> f32 {
    let world_center = frame.toward(center, shading_point);
    let to_center = frame.to_local * world_center;
    let dist_sq = to_center.length_squared();
    let sin_max_sq = radius * radius / dist_sq;
    if !(dist_sq >= f32::MIN_POSITIVE && sin_max_sq < 1.0) {
        return 0.0;
    }
    let one_minus_cos_max = sin_max_sq / (1.0 + (1.0 - sin_max_sq).sqrt());
    // Projects the point back onto the sphere, so that a flat instance does not stretch its
    // rounding error.
    let normal = (frame.to_local * (toward - world_center)).normalize_or_zero();
    let hit = (to_center + normal * radius).length();
    let is_close = hit <= CLOSE * dist_sq.sqrt();
    let local = if is_close { (frame.to_local * toward).length() } else { hit };
    let stretch = toward.length() / local;
    let (cubed, solid_angle) = (stretch * stretch * stretch, 2.0 * PI * one_minus_cos_max * frame.determinant.abs());
    let is_lit = solid_angle >= f32::MIN_POSITIVE && local > 0.0;
    if is_lit && is_density(cubed, solid_angle) { cubed / solid_angle } else { 0.0 }
}

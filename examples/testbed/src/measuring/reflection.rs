//! The exact light that a glossy surface reflects of one light, without shadows.

use super::irradiance::irradiance;
use girandole::glam::{DVec3, Vec3};
use girandole::light::luminance;
use girandole::{Gloss, Light, ShadingPoint, Shape};
use std::f64::consts::PI;

/// The pieces along each edge of a surface that is integrated, at most.
const MAX_PIECES: usize = 24;
/// The size of a piece as an angle, per unit of α and of the cosine of the view.
const PIECE_ANGLE: f64 = 0.5;

/// The light of one light that a surface reflects toward the viewer: the integral of BRDF, cosine
/// and radiance, as luminance in nits. For a matte surface the illuminance in lux.
///
/// Exact for points and spots. Rectangles and triangles are divided into pieces that are small
/// beside the specular lobe, or into [`MAX_PIECES`] squared; each counts as a point. The BRDF of a
/// sphere is that of its centre.
pub fn reflection(light: &Light, at: &ShadingPoint) -> f64 {
    let Some(gloss) = &at.gloss else { return irradiance(light, at) };
    let brdf = |point: Vec3| brdf(gloss, at, point.as_dvec3() - at.position.as_dvec3());
    match light.shape {
        Shape::Point { position } | Shape::Spot { position, .. } | Shape::Profile { position, .. } => {
            brdf(position) * irradiance(light, at)
        }
        Shape::Sphere { center, .. } => brdf(center) * irradiance(light, at),
        Shape::Rectangle { center, half_u, half_v, .. } => {
            let n = pieces(gloss, at, center, half_u.length().max(half_v.length()) * 2.0);
            let step = |i: usize| (2 * i + 1) as f32 / n as f32 - 1.0;
            let piece = |i: usize| {
                let point = center + half_u * step(i % n) + half_v * step(i / n);
                brdf(point) * from_piece(light, at, point, half_u.cross(half_v) * (4.0 / (n * n) as f32))
            };
            (0..n * n).map(piece).sum()
        }
        Shape::Triangle { vertices: [p, q, r], .. } => {
            let (u, v) = (q - p, r - p);
            let n = pieces(gloss, at, p, u.length().max(v.length()));
            // The cells of a parallelogram, of which each half stands for one piece of the
            // triangle: those beyond its diagonal are the upside-down pieces.
            let piece = |i: usize| {
                let (row, column) = (i / n, i % n);
                let is_upright = row + column < n;
                let [row, column] = if is_upright { [row, column] } else { [n - 1 - row, n - 1 - column] };
                let offset = if is_upright { 1.0 / 3.0 } else { 2.0 / 3.0 };
                let at_cell = |cell: usize| (cell as f32 + offset) / n as f32;
                let point = p + u * at_cell(row) + v * at_cell(column);
                brdf(point) * from_piece(light, at, point, u.cross(v) * (0.5 / (n * n) as f32))
            };
            (0..n * n).map(piece).sum()
        }
        _ => unreachable!("this version has no others"),
    }
}

/// The number of pieces along an edge of a surface of this size.
fn pieces(gloss: &Gloss, at: &ShadingPoint, center: Vec3, size: f32) -> usize {
    let alpha = f64::from(gloss.roughness).powi(2);
    let cosine = f64::from(gloss.view.normalize_or_zero().dot(at.normal)).max(0.05);
    let angle = f64::from(size) / f64::from(center.distance(at.position)).max(1.0e-6);
    ((angle / (PIECE_ANGLE * alpha * cosine)).ceil() as usize).clamp(2, MAX_PIECES)
}

/// The illuminance by a piece of a flat light; `normal_area` is its normal times its area.
fn from_piece(light: &Light, at: &ShadingPoint, point: Vec3, normal_area: Vec3) -> f64 {
    let (Shape::Rectangle { two_sided, .. } | Shape::Triangle { two_sided, .. }) = light.shape else { return 0.0 };
    let toward = point.as_dvec3() - at.position.as_dvec3();
    let dist_sq = toward.length_squared();
    let facing = -normal_area.as_dvec3().dot(toward);
    let facing = if two_sided { facing.abs() } else { facing.max(0.0) };
    let cosine = at.normal.as_dvec3().dot(toward).max(0.0);
    let window = (1.0 - (dist_sq / f64::from(light.range).powi(2)).powi(2)).max(0.0);
    let lux = facing * cosine / (dist_sq * dist_sq);
    if dist_sq > 0.0 { f64::from(luminance(light.emission)) * lux * window } else { 0.0 }
}

/// The BRDF per steradian: a Lambertian part and GGX with Smith's height-correlated shadowing and
/// Schlick's Fresnel term. `toward` points to the light and has any length.
pub fn brdf(gloss: &Gloss, at: &ShadingPoint, toward: DVec3) -> f64 {
    let (normal, view) = (at.normal.as_dvec3(), gloss.view.as_dvec3().normalize_or_zero());
    let light = toward.normalize_or_zero();
    let half = (view + light).normalize_or_zero();
    let (cos_light, cos_view) = (normal.dot(light).max(1.0e-9), normal.dot(view).max(1.0e-9));
    let alpha_sq = f64::from(gloss.roughness).powi(4);
    let tangent_sq = normal.cross(half).length_squared();
    let scaled = tangent_sq + normal.dot(half).powi(2) * alpha_sq;
    let distribution = alpha_sq / (PI * scaled * scaled);
    let smith = |a: f64, b: f64| a * (b * b * (1.0 - alpha_sq) + alpha_sq).sqrt();
    let visibility = 0.5 / (smith(cos_light, cos_view) + smith(cos_view, cos_light));
    let specular = f64::from(gloss.specular);
    let fresnel = specular + (1.0 - specular) * (1.0 - view.dot(half).clamp(0.0, 1.0)).powi(5);
    f64::from(gloss.diffuse) / PI + fresnel * distribution * visibility
}

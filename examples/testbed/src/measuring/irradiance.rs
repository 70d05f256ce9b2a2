//! The exact light that a shading point receives from one light, without shadows.

use super::emitter::{Emitter, Form, Receiver};
use girandole::glam::{DQuat, DVec3};
use girandole::{Light, ShadingPoint};
use std::f64::consts::PI;

/// The illuminance by a light at a shading point: see [`exact_irradiance`].
pub fn irradiance(light: &Light, at: &ShadingPoint) -> f64 {
    exact_irradiance(&Emitter::from(light), &Receiver::from(at))
}

/// The illuminance by a light at a surface, in lux; at a point in a volume, where no normal weighs
/// the directions, the illuminance of a surface that always faces the light.
///
/// Both are closed forms: Lambert's formula for a polygon that the horizon clips, and the formula
/// of Snyder (1996) for a sphere that the horizon cuts, as in Lagarde and de Rousiers, Moving
/// Frostbite to PBR (2014), section 4.7. The window of a light's range is taken at the centre of
/// the light, so it is exact for points and spots only. 0 inside a sphere and on a light.
pub fn exact_irradiance(light: &Emitter, at: &Receiver) -> f64 {
    let toward = |point: DVec3| point - at.position;
    let normal = at.normal.normalize_or_zero();
    let (center, unlimited) = match light.form {
        Form::Point { position } => {
            let toward = toward(position);
            (toward, from_point(toward, normal))
        }
        Form::Spot { position, direction, inner_angle, outer_angle } => {
            let toward = toward(position);
            let cos = -direction.normalize().dot(toward.normalize_or_zero());
            let cos_outer = outer_angle.cos();
            let width = (inner_angle.cos() - cos_outer).max(1.0e-3);
            (toward, ((cos - cos_outer) / width).clamp(0.0, 1.0).powi(2) * from_point(toward, normal))
        }
        Form::Profile { position, rotation, profile } => {
            let toward = toward(position);
            let in_lamp = DQuat::from_array(rotation.map(f64::from)).inverse() * -toward;
            let candela = f64::from(profile.candela(in_lamp.normalize_or_zero().as_vec3()));
            (toward, candela * from_point(toward, normal))
        }
        Form::Rectangle { center, half_u: u, half_v: v, two_sided } => {
            let center = toward(center);
            let corners = [center - u - v, center + u - v, center + u + v, center - u + v];
            (center, from_polygon(&corners, two_sided, normal))
        }
        Form::Triangle { vertices, two_sided } => {
            let corners = vertices.map(toward);
            ((corners[0] + corners[1] + corners[2]) / 3.0, from_polygon(&corners, two_sided, normal))
        }
        Form::Sphere { center, radius } => {
            let toward = toward(center);
            (toward, from_sphere(toward, radius, normal))
        }
    };
    let window = 1.0 - (center.length() / light.range).powi(4);
    light.emission * unlimited * window.max(0.0)
}

/// By a point of one candela.
fn from_point(toward: DVec3, normal: DVec3) -> f64 {
    let dist_sq = toward.length_squared();
    if dist_sq <= 0.0 { 0.0 } else { cosine(toward / dist_sq.sqrt(), normal) / dist_sq }
}

/// The cosine at the shading point, which is 1 in a volume.
fn cosine(direction: DVec3, normal: DVec3) -> f64 {
    if normal == DVec3::ZERO { 1.0 } else { normal.dot(direction).max(0.0) }
}

/// By a polygon of one nit, whose front has its corners counter-clockwise.
fn from_polygon(corners: &[DVec3], two_sided: bool, normal: DVec3) -> f64 {
    let front = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let is_in_front = -front.dot(corners[0]) > 0.0;
    if !(two_sided || is_in_front) {
        return 0.0;
    }
    if normal == DVec3::ZERO {
        return (1..corners.len() - 1).map(|i| solid_angle([corners[0], corners[i], corners[i + 1]])).sum();
    }
    let above = clipped(corners, normal);
    let edges = above.iter().zip(above.iter().cycle().skip(1));
    let sum: f64 = edges.map(|(a, b)| angle(*a, *b) * a.cross(*b).normalize_or_zero().dot(normal)).sum();
    0.5 * sum.abs()
}

/// The part of a polygon above the horizon.
fn clipped(corners: &[DVec3], normal: DVec3) -> Vec<DVec3> {
    let mut above = Vec::with_capacity(corners.len() + 1);
    for (a, b) in corners.iter().zip(corners.iter().cycle().skip(1)) {
        let (height_a, height_b) = (normal.dot(*a), normal.dot(*b));
        if height_a > 0.0 {
            above.push(*a);
        }
        if (height_a > 0.0) != (height_b > 0.0) {
            above.push(*a + (*b - *a) * (height_a / (height_a - height_b)));
        }
    }
    above
}

fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// Source: Van Oosterom and Strackee, The Solid Angle of a Plane Triangle (1983).
fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let [x, y, z] = [a.length(), b.length(), c.length()];
    let divisor = x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y;
    2.0 * a.dot(b.cross(c)).abs().atan2(divisor)
}

/// By a sphere of one nit.
fn from_sphere(toward: DVec3, radius: f64, normal: DVec3) -> f64 {
    let sin_sq = radius * radius / toward.length_squared();
    if sin_sq.is_nan() || sin_sq >= 1.0 {
        return 0.0;
    }
    if normal == DVec3::ZERO {
        return 2.0 * PI * sin_sq / (1.0 + (1.0 - sin_sq).sqrt());
    }
    let cos = normal.dot(toward.normalize());
    if cos * cos > sin_sq {
        return PI * sin_sq * cos.max(0.0);
    }
    let sin = (1.0 - cos * cos).sqrt();
    let x = (1.0 / sin_sq - 1.0).sqrt();
    let y = -x * cos / sin;
    let height = sin * (1.0 - y * y).max(0.0).sqrt();
    ((cos * y.clamp(-1.0, 1.0).acos() - x * height) * sin_sq + (height / x).atan()).max(0.0)
}

//! The importance of the light tree of Cycles, Blender's path tracer, on a binary tree.
//!
//! Source: the light tree of Cycles (kernel/light/tree.h; "Light Tree" in Blender's manual), after
//! Conty Estevez and Kulla (2018). The probability of a child is the mean of its shares of the
//! greatest and of the least light that can arrive. Where the least is 0 for both, children that
//! can contribute share it evenly. Energy is intensity; for surfaces, along the normal.
//!
//! Differs: leaves have one light, where Cycles may keep several; there are no instances; the
//! intensity of a spot is its mean over all directions, not its peak (mean sigma on city S 4.8
//! instead of 5.4).

use super::tree::{Formula, LightBounds};
use girandole::cluster::Aabb;
use girandole::glam::Vec3;
use girandole::light::luminance;
use girandole::{Light, ShadingPoint, Shape};
use std::f32::consts::PI;

/// The least distance, in metres: importances stay finite.
const MIN_DISTANCE: f32 = 1.0e-6;

/// The formula of Cycles.
#[derive(Clone, Copy, Debug)]
pub struct Cycles;

/// The bounds of a node.
#[derive(Clone, Copy)]
pub struct CyclesBounds {
    aabb: Aabb,
    cone: Emission,
    energy: f32,
}

/// The cone of normals, and the emission angle around it.
#[derive(Clone, Copy)]
struct Emission {
    axis: Vec3,
    sin_o: f32,
    cos_o: f32,
    /// The cosine of the sum of both angles; below -1 where the sum exceeds half a turn.
    cos_reach: f32,
    /// The cosine of the emission angle minus the angle of the normals; above 1 where the
    /// difference is negative.
    cos_core: f32,
}

impl Emission {
    fn new(axis: Vec3, theta_o: f32, theta_e: f32) -> Self {
        let (sin_o, cos_o) = theta_o.sin_cos();
        let cos_reach = if theta_o + theta_e > PI { -2.0 } else { (theta_o + theta_e).cos() };
        let cos_core = if theta_e < theta_o { 2.0 } else { (theta_e - theta_o).cos() };
        Self { axis, sin_o, cos_o, cos_reach, cos_core }
    }
}

/// A group of lights as seen from the shading point.
struct Extent {
    /// Unit vector towards its middle.
    direction: Vec3,
    /// The cosine of the half-angle that it covers.
    cos_u: f32,
    /// The least distance, in metres.
    nearest: f32,
    /// The greatest distance, in metres.
    farthest: f32,
}

/// The greatest and the least light that can arrive.
#[derive(Clone, Copy, Default)]
struct Range {
    most: f32,
    least: f32,
}

impl Formula for Cycles {
    type Bounds = CyclesBounds;

    fn bounds(light: &Light) -> LightBounds {
        let emission = luminance(light.emission);
        match light.shape {
            Shape::Point { .. } => LightBounds::all_round(light, emission),
            Shape::Profile { .. } => LightBounds::all_round(light, light.flux() / (4.0 * PI)),
            Shape::Sphere { radius, .. } => LightBounds::all_round(light, emission * PI * radius * radius),
            Shape::Spot { direction, outer_angle, .. } => {
                LightBounds::spot(light, direction, [0.0, outer_angle], light.flux() / (4.0 * PI))
            }
            Shape::Rectangle { two_sided, .. } | Shape::Triangle { two_sided, .. } => {
                let sides = if two_sided { 2.0 } else { 1.0 };
                let bounds = LightBounds::flat(light, emission * light.area().unwrap_or(0.0) / sides);
                if two_sided { LightBounds { theta_o: PI, ..bounds } } else { bounds }
            }
            _ => unreachable!("this version has no others"),
        }
    }

    fn pack(bounds: &LightBounds) -> CyclesBounds {
        let cone = Emission::new(bounds.axis, bounds.theta_o, bounds.theta_e);
        CyclesBounds { aabb: bounds.aabb, cone, energy: bounds.power }
    }

    fn first_probability(&self, children: [(&CyclesBounds, Option<&Light>); 2], at: &ShadingPoint) -> Option<f32> {
        let [a, b] = children.map(|(bounds, light)| match light {
            Some(light) => light_range(bounds, light, at),
            None => node_range(bounds, at),
        });
        if a.most + b.most <= 0.0 {
            return None;
        }
        let by_most = a.most / (a.most + b.most);
        let by_least = match (a.least + b.least > 0.0, a.most > 0.0, b.most > 0.0) {
            (true, ..) => a.least / (a.least + b.least),
            (_, true, true) => 0.5,
            (_, true, false) => 1.0,
            (_, false, _) => 0.0,
        };
        Some(0.5 * (by_most + by_least))
    }
}

fn node_range(bounds: &CyclesBounds, at: &ShadingPoint) -> Range {
    let Aabb { min, max } = bounds.aabb;
    let half = (max - min) * 0.5;
    let toward = bounds.aabb.center() - at.position;
    let highest = at.normal.dot(toward) + at.normal.abs().dot(half);
    if at.normal != Vec3::ZERO && highest <= 0.0 {
        return Range::default();
    }
    let direction = toward.normalize_or_zero();
    let [position, low, high] = [at.position, min, max].map(|corner| corner.to_array());
    let is_inside = (0..3).all(|axis| position[axis] > low[axis] && position[axis] < high[axis]);
    let corners = (0..8).map(|corner| {
        let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
        Vec3::from_array([pick(0), pick(1), pick(2)])
    });
    let cos_u = if is_inside { -1.0 } else { cos_cover(direction, corners, at) };
    let distance = toward.length().max(0.5 * half.length());
    range(&bounds.cone, bounds.energy, &Extent { direction, cos_u, nearest: distance, farthest: distance }, at)
}

fn light_range(bounds: &CyclesBounds, light: &Light, at: &ShadingPoint) -> Range {
    match light.shape {
        Shape::Point { position } | Shape::Profile { position, .. } => round_range(bounds, None, position, 0.0, at),
        Shape::Sphere { center, radius } => round_range(bounds, None, center, radius, at),
        Shape::Spot { position, .. } => round_range(bounds, Some(&bounds.cone), position, 0.0, at),
        Shape::Triangle { vertices, .. } => flat_range(bounds, &vertices, at),
        Shape::Rectangle { center, half_u: u, half_v: v, .. } => {
            flat_range(bounds, &[center - u - v, center - u + v, center + u - v, center + u + v], at)
        }
        _ => unreachable!("this version has no others"),
    }
}

/// The range of a point, spot or sphere. Without a cone the light faces the shading point.
fn round_range(bounds: &CyclesBounds, cone: Option<&Emission>, center: Vec3, radius: f32, at: &ShadingPoint) -> Range {
    let toward = center - at.position;
    let direction = toward.normalize_or_zero();
    let reach = toward.length().hypot(radius).max(MIN_DISTANCE);
    let facing = Emission { axis: -direction, sin_o: 0.0, cos_o: 1.0, cos_reach: 0.0, cos_core: 0.0 };
    let extent = Extent { direction, cos_u: toward.length() / reach, nearest: reach, farthest: reach };
    range(cone.unwrap_or(&facing), bounds.energy, &extent, at)
}

fn flat_range(bounds: &CyclesBounds, corners: &[Vec3], at: &ShadingPoint) -> Range {
    let sum = corners.iter().fold(Vec3::ZERO, |sum, corner| sum + *corner);
    let toward = sum / corners.len() as f32 - at.position;
    let direction = toward.normalize_or_zero();
    let is_above = at.normal == Vec3::ZERO || corners.iter().any(|corner| (*corner - at.position).dot(at.normal) > 0.0);
    // A two-sided light has a cone of all directions.
    let is_front = bounds.cone.cos_o < 1.0 || bounds.cone.axis.dot(direction) < 0.0;
    if !is_above || !is_front {
        return Range::default();
    }
    let farthest = corners.iter().map(|corner| corner.distance(at.position)).fold(0.0, f32::max);
    let cos_u = cos_cover(direction, corners.iter().copied(), at);
    range(&bounds.cone, bounds.energy, &Extent { direction, cos_u, nearest: toward.length(), farthest }, at)
}

/// The cosine of the greatest angle between a direction and the directions to the corners.
fn cos_cover(direction: Vec3, corners: impl Iterator<Item = Vec3>, at: &ShadingPoint) -> f32 {
    let cosines = corners.map(|corner| direction.dot((corner - at.position).normalize_or_zero()));
    cosines.fold(1.0, f32::min)
}

fn range(cone: &Emission, energy: f32, extent: &Extent, at: &ShadingPoint) -> Range {
    let (cos_u, sin_u) = (extent.cos_u, sine(extent.cos_u));
    let (mut cos_best, mut cos_worst) = (1.0, 1.0);
    if at.normal != Vec3::ZERO {
        let cos = at.normal.dot(extent.direction).clamp(-1.0, 1.0);
        let sin = sine(cos);
        cos_best = if cos >= cos_u { 1.0 } else { cos * cos_u + sin * sin_u };
        if cos_best < 0.0 {
            return Range::default();
        }
        cos_worst = (cos * cos_u - sin * sin_u).max(0.0);
    }

    let cos = (-cone.axis.dot(extent.direction)).clamp(-1.0, 1.0);
    let sin = sine(cos);
    let cos_near = cos * cos_u + sin * sin_u;
    let emission_best = if cos >= cos_u || cos_near >= cone.cos_o {
        1.0
    } else if cos_near > cone.cos_reach {
        cos_near * cone.cos_o + sine(cos_near) * cone.sin_o
    } else {
        return Range::default();
    };
    let nearest = extent.nearest.max(MIN_DISTANCE);
    let most = (cos_best * energy * emission_best / (nearest * nearest)).abs();

    let cos_far = cos * cos_u - sin * sin_u;
    if cos < 0.0 || cos_u < 0.0 || cos_far < cone.cos_core {
        return Range { most, least: 0.0 };
    }
    let emission_worst = cos_far * cone.cos_o - sine(cos_far) * cone.sin_o;
    let farthest = extent.farthest.max(MIN_DISTANCE);
    Range { most, least: (cos_worst * energy * emission_worst / (farthest * farthest)).abs() }
}

fn sine(cos: f32) -> f32 {
    (1.0 - cos * cos).max(0.0).sqrt()
}

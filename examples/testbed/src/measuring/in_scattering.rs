//! The exact light that a segment of a ray receives from one light, without shadows.

use super::irradiance::irradiance;
use girandole::glam::DVec3;
use girandole::{Light, ShadingPoint, Shape};
use std::f64::consts::{FRAC_PI_2, PI};

/// The nodes of a Gauss rule with eight points on [-1, 1], and their weights, for one half.
const NODES: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_5),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_3),
];

/// A segment of a ray in f64.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub origin: DVec3,
    /// A unit vector.
    pub direction: DVec3,
    /// In metres.
    pub length: f64,
    /// The extinction of a homogeneous medium, per metre, on the way from the light to the segment
    /// and along the segment to its origin.
    pub extinction: f64,
}

impl Ray {
    /// The segment of a shading point.
    pub fn of(at: &ShadingPoint) -> Self {
        let segment = at.segment.as_dvec3();
        let origin = at.position.as_dvec3() - 0.5 * segment;
        Self { origin, direction: segment.normalize_or_zero(), length: segment.length(), extinction: 0.0 }
    }

    /// The point in the volume at a distance from the origin.
    pub fn point(&self, along: f64) -> ShadingPoint {
        ShadingPoint::volume((self.origin + self.direction * along).as_vec3())
    }
}

/// The integral over a segment of the illuminance by a light, in lux times metres, where each point
/// faces the light, attenuated by the medium.
///
/// The variable of integration is the angle at which the light's centre sees the segment, so the
/// integrand is constant for a point without range. The integral is divided where the emission or
/// the range of the light begins and ends, and into `panels` more; each has a Gauss rule of eight
/// points.
pub fn in_scattered(light: &Light, ray: &Ray, panels: usize) -> f64 {
    let center = match light.shape {
        Shape::Point { position } | Shape::Spot { position, .. } | Shape::Profile { position, .. } => {
            position.as_dvec3()
        }
        Shape::Rectangle { center, .. } | Shape::Sphere { center, .. } => center.as_dvec3(),
        Shape::Triangle { vertices: [p, q, r], .. } => (p + q + r).as_dvec3() / 3.0,
        _ => unreachable!("this version has no others"),
    };
    let from_origin = center - ray.origin;
    let foot = from_origin.dot(ray.direction);
    let across = from_origin - ray.direction * foot;
    let size_sq = match light.shape {
        Shape::Rectangle { half_u, half_v, .. } => f64::from(half_u.length_squared() + half_v.length_squared()) / 3.0,
        Shape::Triangle { vertices: [p, q, r], .. } => f64::from(p.distance_squared(q) + p.distance_squared(r)) / 12.0,
        Shape::Sphere { radius, .. } => f64::from(radius * radius),
        _ => 0.0,
    };
    let soft = (across.length_squared() + size_sq).sqrt().max(1.0e-9);
    let angle = |place: f64| (place / soft).atan();
    let ends = [angle(-foot), angle(ray.length - foot)];
    let mut cuts = vec![ends[0], ends[1]];
    let range = f64::from(light.range);
    if range < 1.0e17 && range * range > across.length_squared() {
        let reach = (range * range - across.length_squared()).sqrt();
        cuts.extend([angle(-reach), angle(reach)]);
    }
    let mut cut_by_cone = |axis: DVec3, cos: f64| {
        let (line, x, y) = (across.length(), -axis.dot(across), axis.dot(ray.direction) * across.length());
        let (turn, ratio) = (y.atan2(x), cos * line / x.hypot(y));
        if ratio.abs() < 1.0 {
            for angle_of_line in [turn - ratio.acos(), turn + ratio.acos()] {
                let turned = (angle_of_line + PI).rem_euclid(2.0 * PI) - PI;
                if turned.abs() < FRAC_PI_2 {
                    cuts.push(angle(line * turned.tan()));
                }
            }
        }
    };
    match light.shape {
        Shape::Spot { direction, inner_angle, outer_angle, .. } => {
            let axis = direction.as_dvec3().normalize();
            let cos = f64::from(outer_angle.cos());
            cut_by_cone(axis, cos);
            cut_by_cone(axis, f64::from(inner_angle.cos()).max(cos + 1.0e-3));
        }
        Shape::Rectangle { half_u, half_v, .. } => {
            cut_by_cone(half_u.as_dvec3().cross(half_v.as_dvec3()).normalize(), 0.0)
        }
        Shape::Triangle { vertices: [p, q, r], .. } => {
            cut_by_cone((q - p).as_dvec3().cross((r - p).as_dvec3()).normalize(), 0.0);
        }
        _ => {}
    }
    cuts.retain(|cut| *cut >= ends[0] && *cut <= ends[1]);
    cuts.sort_by(f64::total_cmp);
    let value = |angle: f64| {
        let place = soft * angle.tan();
        let at = ray.point(foot + place);
        let way = foot + place + at.position.as_dvec3().distance(center);
        irradiance(light, &at) * (-ray.extinction * way).exp() * (soft * soft + place * place) / soft
    };
    let mut sum = 0.0;
    for pair in cuts.windows(2) {
        let width = (pair[1] - pair[0]) / panels as f64;
        for panel in 0..panels {
            let middle = pair[0] + (panel as f64 + 0.5) * width;
            let half = 0.5 * width;
            for (node, weight) in NODES {
                sum += weight * half * (value(middle - node * half) + value(middle + node * half));
            }
        }
    }
    sum
}

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

use super::bounds::LightBounds;
use super::tree::Formula;
use crate::measuring::emitter::{Emitter, Form, RealAabb, Receiver};
use crate::measuring::real::{Real, Vector};

/// The least distance, in metres: importances stay finite.
const MIN_DISTANCE: f64 = 1.0e-6;

/// The formula of Cycles.
#[derive(Clone, Copy, Debug)]
pub struct Cycles;

/// The bounds of a node.
#[derive(Clone, Copy)]
pub struct CyclesBounds<R: Real> {
    aabb: RealAabb<R>,
    cone: Emission<R>,
    energy: R,
}

/// The cone of normals, and the emission angle around it.
#[derive(Clone, Copy)]
struct Emission<R: Real> {
    axis: R::Vec3,
    sin_o: R,
    cos_o: R,
    /// The cosine of the sum of both angles; below -1 where the sum exceeds half a turn.
    cos_reach: R,
    /// The cosine of the emission angle minus the angle of the normals; above 1 where the
    /// difference is negative.
    cos_core: R,
}

impl<R: Real> Emission<R> {
    fn new(axis: R::Vec3, theta_o: R, theta_e: R) -> Self {
        let (sin_o, cos_o) = theta_o.sin_cos();
        let cos_reach = if theta_o + theta_e > R::PI() { R::of(-2.0) } else { (theta_o + theta_e).cos() };
        let cos_core = if theta_e < theta_o { R::of(2.0) } else { (theta_e - theta_o).cos() };
        Self { axis, sin_o, cos_o, cos_reach, cos_core }
    }
}

/// A group of lights as seen from the shading point.
struct Extent<R: Real> {
    /// Unit vector towards its middle.
    direction: R::Vec3,
    /// The cosine of the half-angle that it covers.
    cos_u: R,
    /// The least distance, in metres.
    nearest: R,
    /// The greatest distance, in metres.
    farthest: R,
}

/// The greatest and the least light that can arrive.
#[derive(Clone, Copy, Default)]
struct Range<R> {
    most: R,
    least: R,
}

impl<R: Real> Formula<R> for Cycles {
    type Bounds = CyclesBounds<R>;

    fn bounds(light: &Emitter<R>) -> LightBounds<R> {
        match light.form {
            Form::Point { .. } => LightBounds::all_round(light, light.emission),
            Form::Profile { .. } => LightBounds::all_round(light, light.flux() / (R::of(4.0) * R::PI())),
            Form::Sphere { radius, .. } => LightBounds::all_round(light, light.emission * R::PI() * radius * radius),
            Form::Spot { direction, outer_angle, .. } => {
                LightBounds::spot(light, direction, [R::zero(), outer_angle], light.flux() / (R::of(4.0) * R::PI()))
            }
            Form::Rectangle { two_sided, .. } | Form::Triangle { two_sided, .. } => {
                let sides = R::of(if two_sided { 2.0 } else { 1.0 });
                let bounds = LightBounds::flat(light, light.emission * light.area() / sides);
                if two_sided { LightBounds { theta_o: R::PI(), ..bounds } } else { bounds }
            }
        }
    }

    fn pack(bounds: &LightBounds<R>) -> CyclesBounds<R> {
        let cone = Emission::new(bounds.axis, bounds.theta_o, bounds.theta_e);
        CyclesBounds { aabb: bounds.aabb, cone, energy: bounds.power }
    }

    fn first_probability(&self, children: [(&CyclesBounds<R>, Option<&Emitter<R>>); 2], at: &Receiver<R>) -> Option<R> {
        let [a, b] = children.map(|(bounds, light)| match light {
            Some(light) => light_range(bounds, light, at),
            None => node_range(bounds, at),
        });
        if a.most + b.most <= R::zero() {
            return None;
        }
        let by_most = a.most / (a.most + b.most);
        let by_least = match (a.least + b.least > R::zero(), a.most > R::zero(), b.most > R::zero()) {
            (true, ..) => a.least / (a.least + b.least),
            (_, true, true) => R::of(0.5),
            (_, true, false) => R::one(),
            (_, false, _) => R::zero(),
        };
        Some(R::of(0.5) * (by_most + by_least))
    }
}

fn node_range<R: Real>(bounds: &CyclesBounds<R>, at: &Receiver<R>) -> Range<R> {
    let RealAabb { min, max } = bounds.aabb;
    let half = (max - min) * R::of(0.5);
    let toward = bounds.aabb.center() - at.position;
    let highest = at.normal.dot(toward) + at.normal.abs().dot(half);
    if at.normal != R::Vec3::ZERO && highest <= R::zero() {
        return Range::default();
    }
    let direction = toward.normalize_or_zero();
    let [position, low, high] = [at.position, min, max].map(|corner| corner.to_array());
    let is_inside = (0..3).all(|axis| position[axis] > low[axis] && position[axis] < high[axis]);
    let corners = (0..8).map(|corner| {
        let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
        R::Vec3::from_array([pick(0), pick(1), pick(2)])
    });
    let cos_u = if is_inside { -R::one() } else { cos_cover(direction, corners, at) };
    let distance = toward.length().max(R::of(0.5) * half.length());
    range(&bounds.cone, bounds.energy, &Extent { direction, cos_u, nearest: distance, farthest: distance }, at)
}

fn light_range<R: Real>(bounds: &CyclesBounds<R>, light: &Emitter<R>, at: &Receiver<R>) -> Range<R> {
    match light.form {
        Form::Point { position } | Form::Profile { position, .. } => round_range(bounds, None, position, R::zero(), at),
        Form::Sphere { center, radius } => round_range(bounds, None, center, radius, at),
        Form::Spot { position, .. } => round_range(bounds, Some(&bounds.cone), position, R::zero(), at),
        Form::Triangle { vertices, .. } => flat_range(bounds, &vertices, at),
        Form::Rectangle { center, half_u: u, half_v: v, .. } => {
            flat_range(bounds, &[center - u - v, center - u + v, center + u - v, center + u + v], at)
        }
    }
}

/// The range of a point, spot or sphere. Without a cone the light faces the shading point.
fn round_range<R: Real>(
    bounds: &CyclesBounds<R>,
    cone: Option<&Emission<R>>,
    center: R::Vec3,
    radius: R,
    at: &Receiver<R>,
) -> Range<R> {
    let toward = center - at.position;
    let direction = toward.normalize_or_zero();
    let reach = toward.length().hypot(radius).max(R::of(MIN_DISTANCE));
    let [zero, one] = [R::zero(), R::one()];
    let facing = Emission { axis: -direction, sin_o: zero, cos_o: one, cos_reach: zero, cos_core: zero };
    let extent = Extent { direction, cos_u: toward.length() / reach, nearest: reach, farthest: reach };
    range(cone.unwrap_or(&facing), bounds.energy, &extent, at)
}

fn flat_range<R: Real>(bounds: &CyclesBounds<R>, corners: &[R::Vec3], at: &Receiver<R>) -> Range<R> {
    let sum = corners.iter().fold(R::Vec3::ZERO, |sum, corner| sum + *corner);
    let toward = sum / R::of(corners.len() as f64) - at.position;
    let direction = toward.normalize_or_zero();
    let is_above =
        at.normal == R::Vec3::ZERO || corners.iter().any(|corner| (*corner - at.position).dot(at.normal) > R::zero());
    // A two-sided light has a cone of all directions.
    let is_front = bounds.cone.cos_o < R::one() || bounds.cone.axis.dot(direction) < R::zero();
    if !is_above || !is_front {
        return Range::default();
    }
    let farthest = corners.iter().map(|corner| corner.distance(at.position)).fold(R::zero(), R::max);
    let cos_u = cos_cover(direction, corners.iter().copied(), at);
    range(&bounds.cone, bounds.energy, &Extent { direction, cos_u, nearest: toward.length(), farthest }, at)
}

/// The cosine of the greatest angle between a direction and the directions to the corners.
fn cos_cover<R: Real>(direction: R::Vec3, corners: impl Iterator<Item = R::Vec3>, at: &Receiver<R>) -> R {
    let cosines = corners.map(|corner| direction.dot((corner - at.position).normalize_or_zero()));
    cosines.fold(R::one(), R::min)
}

fn range<R: Real>(cone: &Emission<R>, energy: R, extent: &Extent<R>, at: &Receiver<R>) -> Range<R> {
    let [zero, one] = [R::zero(), R::one()];
    let (cos_u, sin_u) = (extent.cos_u, sine(extent.cos_u));
    let (mut cos_best, mut cos_worst) = (one, one);
    if at.normal != R::Vec3::ZERO {
        let cos = at.normal.dot(extent.direction).clamp(-one, one);
        let sin = sine(cos);
        cos_best = if cos >= cos_u { one } else { cos * cos_u + sin * sin_u };
        if cos_best < zero {
            return Range::default();
        }
        cos_worst = (cos * cos_u - sin * sin_u).max(zero);
    }

    let cos = (-cone.axis.dot(extent.direction)).clamp(-one, one);
    let sin = sine(cos);
    let cos_near = cos * cos_u + sin * sin_u;
    let emission_best = if cos >= cos_u || cos_near >= cone.cos_o {
        one
    } else if cos_near > cone.cos_reach {
        cos_near * cone.cos_o + sine(cos_near) * cone.sin_o
    } else {
        return Range::default();
    };
    let nearest = extent.nearest.max(R::of(MIN_DISTANCE));
    let most = (cos_best * energy * emission_best / (nearest * nearest)).abs();

    let cos_far = cos * cos_u - sin * sin_u;
    if cos < zero || cos_u < zero || cos_far < cone.cos_core {
        return Range { most, least: zero };
    }
    let emission_worst = cos_far * cone.cos_o - sine(cos_far) * cone.sin_o;
    let farthest = extent.farthest.max(R::of(MIN_DISTANCE));
    Range { most, least: (cos_worst * energy * emission_worst / (farthest * farthest)).abs() }
}

fn sine<R: Real>(cos: R) -> R {
    (R::one() - cos * cos).max(R::zero()).sqrt()
}

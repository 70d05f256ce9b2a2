//! The lights that trees hold: what they are, whether they make sense, how much they emit and where to.
//!
//! Units are glTF's: candela for points and spots (KHR_lights_punctual), nits for surfaces, lux for directional lights.

use std::f32::consts::PI;

use glam::Vec3;

use crate::bounds::Aabb;
use crate::cluster::{Cluster, MAX_FLUX};
use crate::cone::{CAP_PADDING, Cone};
use crate::effects::Effects;
use crate::error::LightError;

/// Largest coordinate, radius or edge of a light, in metres. Squares and fourth powers of it stay far inside f32.
pub const MAX_COORDINATE: f32 = 1.0e9;

/// Largest emission per channel, in candela or nits.
pub const MAX_EMISSION: f32 = 1.0e15;

/// The least flux of a light that is not dark, in lumens. Smaller values would be flushed to zero as denormals by
/// some GPUs when divided by a squared distance, and a light that can contribute must keep a chance above zero.
pub(crate) const MIN_FLUX: f32 = 1.0e-18;

/// Length of the mean direction of emission of one flat emitter, that is the mean cosine of Lambert's law.
pub(crate) const LAMBERTIAN: f32 = 2.0 / 3.0;

/// Sine of the angle between a flat emitter's edges below which rounding could turn its normal by more than 1e-5 rad.
const MIN_SINE: f32 = 1.0e-2;

/// Least entry of a cross product, in square metres, whose square is a normal f32.
const MIN_CROSS: f32 = 1.0e-18;

/// Narrowest falloff between the cosines of a spot's angles, as KHR_lights_punctual has it.
const MIN_SPOT_FALLOFF: f32 = 1.0e-3;

/// Rounding of a spot's falloff at its rim lets through directions this far outside, in radians.
const SPOT_RIM: f32 = 1.0e-3;

/// Shape and place of a light, in the space of its tree. Metres and radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Emits equally to all sides.
    Point {
        /// Where it is.
        position: Vec3,
    },
    /// Emits into a cone, with the falloff of KHR_lights_punctual: full within `inner_angle`, zero from `outer_angle` on.
    Spot {
        /// Where it is.
        position: Vec3,
        /// Unit vector along the cone's axis.
        direction: Vec3,
        /// From the axis, in [0, `outer_angle`].
        inner_angle: f32,
        /// From the axis, in [0, pi].
        outer_angle: f32,
    },
    /// A parallelogram that emits evenly (Lambertian) from the side that `half_u` x `half_v` points to.
    Rectangle {
        /// Its middle.
        center: Vec3,
        /// From the middle to the middle of one edge.
        half_u: Vec3,
        /// From the middle to the middle of the next edge.
        half_v: Vec3,
        /// Emits from its back too.
        two_sided: bool,
    },
    /// A triangle that emits evenly (Lambertian) from the side that sees its vertices counter-clockwise.
    Triangle {
        /// The corners.
        vertices: [Vec3; 3],
        /// Emits from its back too.
        two_sided: bool,
    },
    /// A sphere that emits evenly (Lambertian) outward. Under a non-uniform scale it becomes an ellipsoid.
    Sphere {
        /// Its middle.
        center: Vec3,
        /// At least 0; a radius of 0 emits nothing.
        radius: f32,
    },
}

/// One light of a tree.
///
/// ```
/// use girandole::{Light, glam::Vec3};
/// let lamp = Light::point(Vec3::new(0.0, 6.0, 0.0), Vec3::splat(800.0)).with_range(60.0);
/// assert!(lamp.validate().is_ok());
/// assert!((lamp.flux() - 800.0 * 4.0 * std::f32::consts::PI).abs() < 1.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Kind and place.
    pub shape: Shape,
    /// Linear Rec. 709. Candela for a point or spot (inside its inner cone), nits for the others.
    pub emission: Vec3,
    /// Metres (of the world, not scaled by instances) from which on the light is exactly zero, with the smooth window
    /// of KHR_lights_punctual before that. Infinity for none.
    pub range: f32,
}

impl Light {
    fn new(shape: Shape, emission: Vec3) -> Self {
        Self { shape, emission, range: f32::INFINITY }
    }

    /// A point light; `intensity` in candela.
    pub fn point(position: Vec3, intensity: Vec3) -> Self {
        Self::new(Shape::Point { position }, intensity)
    }

    /// A spot; angles in radians from its axis, `intensity` in candela.
    pub fn spot(position: Vec3, direction: Vec3, inner_angle: f32, outer_angle: f32, intensity: Vec3) -> Self {
        Self::new(Shape::Spot { position, direction, inner_angle, outer_angle }, intensity)
    }

    /// A one-sided parallelogram with edges of 2 `half_u` and 2 `half_v`; `radiance` in nits.
    pub fn rectangle(center: Vec3, half_u: Vec3, half_v: Vec3, radiance: Vec3) -> Self {
        Self::new(Shape::Rectangle { center, half_u, half_v, two_sided: false }, radiance)
    }

    /// A one-sided emissive triangle; `radiance` in nits.
    pub fn triangle(vertices: [Vec3; 3], radiance: Vec3) -> Self {
        Self::new(Shape::Triangle { vertices, two_sided: false }, radiance)
    }

    /// A sphere; `radiance` in nits.
    pub fn sphere(center: Vec3, radius: f32, radiance: Vec3) -> Self {
        Self::new(Shape::Sphere { center, radius }, radiance)
    }

    /// The same light, exactly zero from `range` metres on.
    pub fn with_range(self, range: f32) -> Self {
        Self { range, ..self }
    }

    /// The same light emitting from both sides, if it is a rectangle or a triangle; other kinds have no sides.
    pub fn two_sided(mut self) -> Self {
        if let Shape::Rectangle { two_sided, .. } | Shape::Triangle { two_sided, .. } = &mut self.shape {
            *two_sided = true;
        }
        self
    }

    /// Whether a tree takes this light. Emission of zero, areas of zero and a spot of any width are fine.
    ///
    /// # Errors
    /// The first field that is not finite, negative where it must not be, or beyond [`MAX_COORDINATE`] or [`MAX_EMISSION`].
    pub fn validate(&self) -> Result<(), LightError> {
        for (what, value) in ["emission.r", "emission.g", "emission.b"].into_iter().zip(self.emission.to_array()) {
            check_between(what, value, 0.0, MAX_EMISSION)?;
        }
        if self.range.is_nan() || self.range <= 0.0 {
            return Err(LightError::OutOfRange { what: "range", value: self.range, min: 0.0, max: f32::INFINITY });
        }
        match self.shape {
            Shape::Point { position } => check_point("position", position),
            Shape::Spot { position, direction, inner_angle, outer_angle } => {
                check_point("position", position)?;
                check_direction("direction", direction)?;
                check_between("outer_angle", outer_angle, 0.0, PI)?;
                check_between("inner_angle", inner_angle, 0.0, outer_angle)
            }
            Shape::Rectangle { center, half_u, half_v, .. } => {
                check_point("center", center)?;
                check_point("half_u", half_u)?;
                check_point("half_v", half_v)
            }
            Shape::Triangle { vertices, .. } => vertices.into_iter().try_for_each(|v| check_point("vertex", v)),
            Shape::Sphere { center, radius } => {
                check_point("center", center)?;
                check_between("radius", radius, 0.0, MAX_COORDINATE)
            }
        }
    }

    /// The box of its emitting points.
    pub fn aabb(&self) -> Aabb {
        match self.shape {
            Shape::Point { position } | Shape::Spot { position, .. } => Aabb::point(position),
            Shape::Rectangle { center, half_u, half_v, .. } => Aabb::around([
                center - half_u - half_v,
                center - half_u + half_v,
                center + half_u - half_v,
                center + half_u + half_v,
            ]),
            Shape::Triangle { vertices, .. } => Aabb::around(vertices),
            Shape::Sphere { center, radius } => Aabb { min: center - radius, max: center + radius },
        }
    }

    /// Emitting area in square metres, both sides counted; `None` for points and spots.
    pub fn area(&self) -> Option<f32> {
        self.exact_area().map(|area| area as f32)
    }

    /// In f64: squares of a micrometre's area are gone in f32.
    fn exact_area(&self) -> Option<f64> {
        let parallelogram = |u: Vec3, v: Vec3| u.as_dvec3().cross(v.as_dvec3()).length();
        match self.shape {
            Shape::Point { .. } | Shape::Spot { .. } => None,
            Shape::Rectangle { half_u, half_v, two_sided, .. } => {
                Some(4.0 * parallelogram(half_u, half_v) * sides(two_sided))
            }
            Shape::Triangle { vertices: [a, b, c], two_sided } => {
                Some(0.5 * parallelogram(b - a, c - a) * sides(two_sided))
            }
            Shape::Sphere { radius, .. } => Some(4.0 * std::f64::consts::PI * f64::from(radius).powi(2)),
        }
    }

    /// Emitted flux in lumens, as the Rec. 709 luminance of `emission` over all directions and area; range ignored.
    /// At most 1e34. A light whose flux is zero, or rounds to it, is dark: it sends nothing and is never chosen.
    pub fn flux(&self) -> f32 {
        let luminance = luminance(self.emission);
        match self.shape {
            Shape::Point { .. } => 4.0 * PI * luminance,
            Shape::Spot { inner_angle, outer_angle, .. } => luminance * spot_lobe(inner_angle, outer_angle).solid_angle,
            _ => {
                let flux = std::f64::consts::PI * f64::from(luminance) * self.exact_area().unwrap_or(0.0);
                flux.min(f64::from(MAX_FLUX)) as f32
            }
        }
    }

    /// All directions that the light emits to.
    pub fn emission_cone(&self) -> Cone {
        match self.shape {
            Shape::Point { .. }
            | Shape::Sphere { .. }
            | Shape::Rectangle { two_sided: true, .. }
            | Shape::Triangle { two_sided: true, .. } => Cone::FULL,
            Shape::Spot { direction, outer_angle, .. } => {
                Cone { axis: direction.normalize_or(Vec3::Z), half_angle: (outer_angle + SPOT_RIM).min(PI) }
            }
            Shape::Rectangle { half_u, half_v, .. } => half_space(half_u, half_v),
            Shape::Triangle { vertices: [a, b, c], .. } => half_space(b - a, c - a),
        }
    }

    /// The cluster of this light alone. A dark light (zero flux) has an empty box, but keeps its place as mean.
    pub fn cluster(&self) -> Cluster {
        let cone = self.emission_cone();
        let (flux, length) = match self.shape {
            Shape::Spot { inner_angle, outer_angle, .. } => {
                let lobe = spot_lobe(inner_angle, outer_angle);
                (luminance(self.emission) * lobe.solid_angle, lobe.mean_cosine)
            }
            // Two sides cancel, and so do all sides of a sphere.
            _ => (self.flux(), if cone.is_full() { 0.0 } else { LAMBERTIAN }),
        };
        let (mean, variance) = match self.shape {
            Shape::Point { position } | Shape::Spot { position, .. } => (position, 0.0),
            Shape::Rectangle { center, half_u, half_v, .. } => {
                (center, (half_u.length_squared() + half_v.length_squared()) / 3.0)
            }
            Shape::Triangle { vertices: [a, b, c], .. } => {
                let mean = (a + b + c) / 3.0;
                // Trace of the covariance of an even distribution over a triangle.
                let spread = (a - mean).length_squared() + (b - mean).length_squared() + (c - mean).length_squared();
                (mean, spread / 12.0)
            }
            Shape::Sphere { center, radius } => (center, radius * radius),
        };
        if flux <= 0.0 {
            return Cluster { mean, ..Cluster::EMPTY };
        }
        // A spot may emit more to its back than to its front: the cap is about the axis that is kept.
        let holds = length > 0.0 && !cone.is_full();
        let flux = flux.max(MIN_FLUX);
        Cluster {
            aabb: self.aabb(),
            flux,
            area_flux: if self.is_punctual() { 0.0 } else { flux },
            mean,
            variance,
            axis: cone.axis * length,
            cos_half_angle: if holds { cone.half_angle.cos() - CAP_PADDING } else { -1.0 },
            range: self.range,
        }
    }

    /// What the light calls for: its kind, whether or not it shines.
    pub fn effects(&self) -> Effects {
        let kind = match self.shape {
            Shape::Point { .. } => Effects::empty(),
            Shape::Spot { .. } => Effects::CONES,
            Shape::Sphere { .. } => Effects::AREAS,
            Shape::Rectangle { two_sided, .. } | Shape::Triangle { two_sided, .. } => {
                Effects::AREAS | if two_sided { Effects::TWO_SIDED } else { Effects::CONES }
            }
        };
        if self.range < f32::INFINITY { kind | Effects::RANGES } else { kind }
    }

    /// Without extent: a point or a spot.
    fn is_punctual(&self) -> bool {
        matches!(self.shape, Shape::Point { .. } | Shape::Spot { .. })
    }
}

/// A light at infinity, like a moon. Kept outside the trees and sampled beside them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionalLight {
    /// Unit vector along which the light travels.
    pub direction: Vec3,
    /// Lux on a surface that faces it, linear Rec. 709.
    pub illuminance: Vec3,
}

impl DirectionalLight {
    /// Whether a world takes this light.
    ///
    /// # Errors
    /// As [`Light::validate`].
    pub fn validate(&self) -> Result<(), LightError> {
        check_direction("direction", self.direction)?;
        let channels = ["illuminance.r", "illuminance.g", "illuminance.b"];
        channels
            .into_iter()
            .zip(self.illuminance.to_array())
            .try_for_each(|(what, value)| check_between(what, value, 0.0, MAX_EMISSION))
    }
}

/// Rec. 709 luminance of a linear colour.
pub fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// The window of KHR_lights_punctual: 1 near the light, exactly 0 from `range` on.
pub(crate) fn range_window(dist_sq: f32, range: f32) -> f32 {
    if dist_sq >= range * range {
        return 0.0;
    }
    let ratio_sq = dist_sq / (range * range);
    1.0 - ratio_sq * ratio_sq
}

/// Scale and offset of the spot falloff `saturate(cos * scale + offset)^2` of KHR_lights_punctual.
pub(crate) fn spot_falloff(inner_angle: f32, outer_angle: f32) -> (f32, f32) {
    let cos_outer = outer_angle.cos();
    let scale = 1.0 / (inner_angle.cos() - cos_outer).max(MIN_SPOT_FALLOFF);
    (scale, -cos_outer * scale)
}

struct SpotLobe {
    solid_angle: f32,
    mean_cosine: f32,
}

/// Integrals of the spot falloff over the sphere. With c the cosine to the axis, t = (c - c_outer) scale runs from 0 to 1
/// over the falloff, and the falloff is t^2.
fn spot_lobe(inner_angle: f32, outer_angle: f32) -> SpotLobe {
    if outer_angle <= 0.0 {
        return SpotLobe { solid_angle: 0.0, mean_cosine: 1.0 };
    }
    let (scale, _) = spot_falloff(inner_angle, outer_angle);
    // 1 - cos without cancellation; the falloff is cut off at c = 1 when it is wider than the whole spot.
    let one_minus_cos = 2.0 * (0.5 * outer_angle).sin().powi(2);
    let width = (1.0 / scale).min(one_minus_cos);
    let t = width * scale;
    let flat = (one_minus_cos - width).max(0.0);
    let integral = flat + width * t * t / 3.0;
    // First moment about c = 1, so that narrow spots do not cancel.
    let moment = flat * flat * 0.5 + t * t * (width * one_minus_cos / 3.0 - width * width / 4.0);
    SpotLobe { solid_angle: 2.0 * PI * integral, mean_cosine: (1.0 - moment / integral).clamp(-1.0, 1.0) }
}

fn sides(two_sided: bool) -> f64 {
    if two_sided { 2.0 } else { 1.0 }
}

/// What the front of a flat emitter sees; all sides if it is too thin or too small for a normal that can be trusted.
fn half_space(u: Vec3, v: Vec3) -> Cone {
    let normal = u.cross(v);
    let is_thin = normal.length_squared() < MIN_SINE * MIN_SINE * u.length_squared() * v.length_squared();
    if is_thin || normal.abs().max_element() < MIN_CROSS {
        return Cone::FULL;
    }
    Cone { axis: normal.normalize(), half_angle: 0.5 * PI }
}

fn check_between(what: &'static str, value: f32, min: f32, max: f32) -> Result<(), LightError> {
    if !value.is_finite() {
        return Err(LightError::NotFinite { what, value });
    }
    if value < min || value > max {
        return Err(LightError::OutOfRange { what, value, min, max });
    }
    Ok(())
}

fn check_point(what: &'static str, p: Vec3) -> Result<(), LightError> {
    p.to_array().into_iter().try_for_each(|value| check_between(what, value, -MAX_COORDINATE, MAX_COORDINATE))
}

/// Directions need not be of unit length to the last bit, but must clearly be directions.
fn check_direction(what: &'static str, d: Vec3) -> Result<(), LightError> {
    check_point(what, d)?;
    let length = d.length();
    if (length - 1.0).abs() > 1.0e-3 { Err(LightError::NoDirection { what, length }) } else { Ok(()) }
}

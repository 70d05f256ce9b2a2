//! Lights: their shapes, the check of their values, and how much they emit in which directions.
//!
//! Units are those of glTF: candela for points and spots (KHR_lights_punctual), nits for surfaces,
//! lux for directional lights.

use std::f32::consts::PI;

use glam::{Quat, Vec3, Vec4};

use crate::cluster::bounds::Aabb;
use crate::cluster::cone::{CAP_PADDING, Cone};
use crate::cluster::{Cluster, MAX_FLUX};
use crate::effects::Effects;
use crate::error::{ValueError, check_range};
use crate::profile::Profile;

/// Largest absolute value of a coordinate of a position, vertex or half edge, and largest radius,
/// in metres. Its square and fourth power stay within f32.
pub const MAX_COORDINATE: f32 = 1.0e9;

/// Largest emission per channel, in candela, nits or lux.
pub const MAX_EMISSION: f32 = 1.0e15;

/// The least flux of a light that is not dark, in lumens. Some GPUs would flush smaller values to
/// zero as denormals when they are divided by a squared distance, and a light that can contribute
/// must keep a probability above zero.
pub(crate) const MIN_FLUX: f32 = 1.0e-18;

/// The effects of a light with a profile.
pub(crate) const PROFILE_EFFECTS: Effects = Effects::PROFILES.union(Effects::CONES);

/// Length of the mean direction of emission of one flat emitter: the mean cosine of Lambert's law.
pub(crate) const LAMBERTIAN: f32 = 2.0 / 3.0;

/// Below this sine of the angle between a flat emitter's edges, rounding could turn its normal by
/// more than 1e-5 rad.
pub(crate) const MIN_SINE: f32 = 1.0e-2;

/// Least entry of a cross product, in square metres, whose square is a normal number in f32.
pub(crate) const MIN_CROSS: f32 = 1.0e-18;

/// Least width of a spot's falloff, as a difference of cosines, as KHR_lights_punctual specifies.
const MIN_SPOT_FALLOFF: f32 = 1.0e-3;

/// Rounding of a spot's falloff at its rim lets through directions this far outside, in radians.
pub(crate) const SPOT_RIM: f32 = 1.0e-3;

/// How far the length of a direction may be from 1. Directions need not be of unit length to the
/// last bit.
pub(crate) const UNIT_TOLERANCE: f32 = 1.0e-3;

/// Shape and position of a light, in the space of its tree. Metres and radians.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Shape {
    /// A point that emits equally in all directions.
    Point {
        /// The position.
        position: Vec3,
    },
    /// A point that emits into a cone, with the falloff of KHR_lights_punctual.
    ///
    /// The intensity at the angle θ from the axis is the emission times
    ///
    /// ```text
    /// clamp((cos θ - cos outer_angle) / max(cos inner_angle - cos outer_angle, 0.001), 0, 1)²
    /// ```
    ///
    /// It is 0 from `outer_angle` on. It is full within `inner_angle` if the cosines of the two
    /// angles differ by at least 0.001. If they differ by less, the falloff is 0.001 wide and
    /// reaches further inward, to the angle whose cosine is cos `outer_angle` + 0.001. Below an
    /// `outer_angle` of 2.56 degrees there is no such angle, and even the axis is below the full
    /// intensity: it has 37 % at 2 degrees and 2.3 % at 1 degree. For a narrower beam of the
    /// intended intensity, divide the emission by that share.
    Spot {
        /// The position.
        position: Vec3,
        /// Unit vector along the cone's axis.
        direction: Vec3,
        /// Radians from the axis up to which the intensity is full, in [0, `outer_angle`].
        inner_angle: f32,
        /// Radians from the axis from which on the intensity is 0, in [0, pi].
        outer_angle: f32,
    },
    /// A point with a photometric profile. Its intensity in a direction is the emission times the candela of
    /// the profile. A placement that is scaled or sheared deforms the beam with the tree.
    Profile {
        /// The position.
        position: Vec3,
        /// The unit quaternion, as x, y, z and w, that turns the lamp from its own space, in which it points
        /// along -Z with the plane C0 along +X.
        rotation: [f32; 4],
        /// The intensities.
        profile: Profile,
    },
    /// A parallelogram that emits evenly (Lambertian) from the side that `half_u` x `half_v` points
    /// to.
    Rectangle {
        /// The center.
        center: Vec3,
        /// From the center to the middle of one edge.
        half_u: Vec3,
        /// From the center to the middle of the next edge.
        half_v: Vec3,
        /// Whether it emits from its back too.
        two_sided: bool,
    },
    /// A triangle that emits evenly (Lambertian) from the side on which its vertices appear
    /// counter-clockwise.
    Triangle {
        /// The corners.
        vertices: [Vec3; 3],
        /// Whether it emits from its back too.
        two_sided: bool,
    },
    /// A sphere that emits evenly (Lambertian) outward. Under a non-uniform scale it becomes an
    /// ellipsoid.
    Sphere {
        /// The center.
        center: Vec3,
        /// At least 0; a sphere of radius 0 emits nothing.
        radius: f32,
    },
}

/// One light of a tree.
///
/// Constructors check nothing. [`Light::validate`] checks a light, and so does every call that
/// adds one to a tree or changes one.
///
/// ```
/// use girandole::{Light, glam::Vec3};
/// let lamp = Light::point(Vec3::new(0.0, 6.0, 0.0), Vec3::splat(800.0)).with_range(60.0);
/// assert!(lamp.validate().is_ok());
/// assert!((lamp.flux() - 800.0 * 4.0 * std::f32::consts::PI).abs() < 1.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Light {
    /// Kind and position.
    pub shape: Shape,
    /// Emission per channel, linear Rec. 709: in candela for points and spots (before the
    /// falloff), a factor for profiles, in nits for the others. At least 0.
    pub emission: Vec3,
    /// Range in metres of the world; the scale of an instance does not change it. At this distance
    /// and beyond, the light is exactly zero. Below it, the light is multiplied by the smooth
    /// window of KHR_lights_punctual. Above 0; infinity for no limit.
    pub range: f32,
}

impl Light {
    /// What a list of lights holds at the index of a light that was removed: a dark point whose
    /// range of 0 no valid light has.
    pub(crate) const REMOVED: Self =
        Self { shape: Shape::Point { position: Vec3::ZERO }, emission: Vec3::ZERO, range: 0.0 };

    /// Whether this is no light, but what [`LightTree::lights`](crate::LightTree::lights) has at
    /// the index of a light that was removed. It emits nothing, and [`Light::validate`] refuses it.
    pub fn is_removed(&self) -> bool {
        self.range == 0.0
    }

    /// Creates a light without a range; `emission` as in [`Light::emission`].
    pub fn new(shape: Shape, emission: Vec3) -> Self {
        Self { shape, emission, range: f32::INFINITY }
    }

    /// Creates a point light; `intensity` in candela.
    pub fn point(position: Vec3, intensity: Vec3) -> Self {
        Self::new(Shape::Point { position }, intensity)
    }

    /// Creates a spot light along the unit vector `direction`; angles in radians from its axis,
    /// `intensity` in candela. [`Shape::Spot`] defines the falloff.
    pub fn spot(position: Vec3, direction: Vec3, inner_angle: f32, outer_angle: f32, intensity: Vec3) -> Self {
        Self::new(Shape::Spot { position, direction, inner_angle, outer_angle }, intensity)
    }

    /// Creates a point light with a profile. [`Profile`] says where it points before the rotation;
    /// `factor` multiplies its candela.
    pub fn profile(position: Vec3, rotation: Quat, profile: Profile, factor: Vec3) -> Self {
        Self::new(Shape::Profile { position, rotation: rotation.to_array(), profile }, factor)
    }

    /// Creates a one-sided parallelogram with edges of 2 `half_u` and 2 `half_v`; `radiance` in
    /// nits.
    pub fn rectangle(center: Vec3, half_u: Vec3, half_v: Vec3, radiance: Vec3) -> Self {
        Self::new(Shape::Rectangle { center, half_u, half_v, two_sided: false }, radiance)
    }

    /// Creates a one-sided triangle, which emits from the side on which its vertices appear
    /// counter-clockwise; `radiance` in nits.
    pub fn triangle(vertices: [Vec3; 3], radiance: Vec3) -> Self {
        Self::new(Shape::Triangle { vertices, two_sided: false }, radiance)
    }

    /// Creates a sphere; `radius` in metres, `radiance` in nits.
    pub fn sphere(center: Vec3, radius: f32, radiance: Vec3) -> Self {
        Self::new(Shape::Sphere { center, radius }, radiance)
    }

    /// The same light with another shape or position.
    #[must_use]
    pub fn with_shape(self, shape: Shape) -> Self {
        Self { shape, ..self }
    }

    /// The same light with another emission, see [`Light::emission`].
    #[must_use]
    pub fn with_emission(self, emission: Vec3) -> Self {
        Self { emission, ..self }
    }

    /// The same light with a range in metres, see [`Light::range`].
    #[must_use]
    pub fn with_range(self, range: f32) -> Self {
        Self { range, ..self }
    }

    /// The same light with emission from both sides if it is a rectangle or a triangle; other kinds
    /// have no sides.
    #[must_use]
    pub fn two_sided(mut self) -> Self {
        if let Shape::Rectangle { two_sided, .. } | Shape::Triangle { two_sided, .. } = &mut self.shape {
            *two_sided = true;
        }
        self
    }

    /// Checks whether a tree accepts this light. Zero emission, zero area and spots of any width
    /// are allowed.
    ///
    /// # Errors
    /// [`ValueError`] for the first number that is not finite or outside its range, [`MAX_COORDINATE`] and
    /// [`MAX_EMISSION`] included; for a range that is not above 0; and for the length of a direction or a
    /// rotation that is not 1 to within 0.001.
    ///
    /// For a profile, [`MAX_EMISSION`] limits the product of the emission and the greatest intensity.
    pub fn validate(&self) -> Result<(), ValueError> {
        for (what, value) in ["emission.r", "emission.g", "emission.b"].into_iter().zip(self.emission.to_array()) {
            check_range(what, value, 0.0, MAX_EMISSION)?;
        }
        if self.range.is_nan() || self.range <= 0.0 {
            let range = ValueError::new("range", self.range.into(), 0.0, f64::INFINITY);
            return Err(ValueError { rule: "above 0", ..range });
        }
        match self.shape {
            Shape::Point { position } => check_point("position", position),
            Shape::Spot { position, direction, inner_angle, outer_angle } => {
                check_point("position", position)?;
                check_direction("the length of direction", direction)?;
                check_range("outer_angle", outer_angle, 0.0, PI)?;
                check_range("inner_angle", inner_angle, 0.0, outer_angle)
            }
            Shape::Profile { position, rotation, profile } => {
                check_point("position", position)?;
                check_unit("the length of rotation", Vec4::from(rotation))?;
                let candela = self.emission.max_element() * profile.greatest_candela();
                check_range("emission times the profile", candela, 0.0, MAX_EMISSION)
            }
            Shape::Rectangle { center, half_u, half_v, .. } => {
                check_point("center", center)?;
                check_point("half_u", half_u)?;
                check_point("half_v", half_v)
            }
            Shape::Triangle { vertices, .. } => vertices.into_iter().try_for_each(|v| check_point("vertex", v)),
            Shape::Sphere { center, radius } => {
                check_point("center", center)?;
                check_range("radius", radius, 0.0, MAX_COORDINATE)
            }
        }
    }

    /// The smallest box around all emitting points, in metres, in the space of the tree.
    pub fn aabb(&self) -> Aabb {
        match self.shape {
            Shape::Point { position } | Shape::Spot { position, .. } | Shape::Profile { position, .. } => {
                Aabb::point(position)
            }
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

    /// Emitting area in square metres, both sides counted; `None` for points, spots and profiles.
    pub fn area(&self) -> Option<f32> {
        self.exact_area().map(|area| area as f32)
    }

    /// In f64: squares of an area of a square micrometre underflow in f32.
    fn exact_area(&self) -> Option<f64> {
        let parallelogram = |u: Vec3, v: Vec3| u.as_dvec3().cross(v.as_dvec3()).length();
        match self.shape {
            Shape::Point { .. } | Shape::Spot { .. } | Shape::Profile { .. } => None,
            Shape::Rectangle { half_u, half_v, two_sided, .. } => {
                Some(4.0 * parallelogram(half_u, half_v) * sides(two_sided))
            }
            Shape::Triangle { vertices: [a, b, c], two_sided } => {
                Some(0.5 * parallelogram(b - a, c - a) * sides(two_sided))
            }
            Shape::Sphere { radius, .. } => Some(4.0 * std::f64::consts::PI * f64::from(radius).powi(2)),
        }
    }

    /// Emitted flux in lumens: the Rec. 709 luminance of `emission` integrated over all directions
    /// and the area. The range is ignored. At most 1e34. A light whose flux is zero, or rounds to
    /// zero, is *dark*: it emits nothing and is never chosen.
    pub fn flux(&self) -> f32 {
        let luminance = luminance(self.emission);
        match self.shape {
            Shape::Point { .. } => 4.0 * PI * luminance,
            Shape::Spot { inner_angle, outer_angle, .. } => luminance * spot_lobe(inner_angle, outer_angle).solid_angle,
            Shape::Profile { profile, .. } => luminance * profile.flux(),
            _ => {
                let flux = std::f64::consts::PI * f64::from(luminance) * self.exact_area().unwrap_or(0.0);
                flux.min(f64::from(MAX_FLUX)) as f32
            }
        }
    }

    /// The cone of all directions that the light emits in.
    pub fn emission_cone(&self) -> Cone {
        match self.shape {
            Shape::Point { .. }
            | Shape::Sphere { .. }
            | Shape::Rectangle { two_sided: true, .. }
            | Shape::Triangle { two_sided: true, .. } => Cone::FULL,
            Shape::Spot { direction, outer_angle, .. } => {
                Cone { axis: direction.normalize_or(Vec3::Z), half_angle: (outer_angle + SPOT_RIM).min(PI) }
            }
            Shape::Profile { rotation, profile, .. } => match profile.mean().try_normalize() {
                Some(mean) => {
                    let axis = (Quat::from_array(rotation) * mean).normalize_or(Vec3::Z);
                    Cone { axis, half_angle: profile.half_angle() }
                }
                None => Cone::FULL,
            },
            Shape::Rectangle { half_u, half_v, .. } => half_space(half_u, half_v),
            Shape::Triangle { vertices: [a, b, c], .. } => half_space(b - a, c - a),
        }
    }

    /// The cluster of this light alone. A dark light (zero flux) has an empty box and keeps its
    /// position as mean.
    pub fn cluster(&self) -> Cluster {
        let cone = self.emission_cone();
        let (flux, length) = match self.shape {
            Shape::Spot { inner_angle, outer_angle, .. } => {
                let lobe = spot_lobe(inner_angle, outer_angle);
                (luminance(self.emission) * lobe.solid_angle, lobe.mean_cosine)
            }
            Shape::Profile { profile, .. } => (self.flux(), profile.mean().length()),
            // Points, spheres and surfaces with two sides have no mean direction.
            _ => (self.flux(), if cone.is_full() { 0.0 } else { LAMBERTIAN }),
        };
        let (mean, variance) = match self.shape {
            Shape::Point { position } | Shape::Spot { position, .. } | Shape::Profile { position, .. } => {
                (position, 0.0)
            }
            Shape::Rectangle { center, half_u, half_v, .. } => {
                (center, (half_u.length_squared() + half_v.length_squared()) / 3.0)
            }
            Shape::Triangle { vertices: [a, b, c], .. } => {
                let mean = (a + b + c) / 3.0;
                // Trace of the covariance of a uniform distribution over a triangle.
                let spread = (a - mean).length_squared() + (b - mean).length_squared() + (c - mean).length_squared();
                (mean, spread / 12.0)
            }
            Shape::Sphere { center, radius } => (center, radius * radius),
        };
        if flux <= 0.0 {
            return Cluster { mean, ..Cluster::EMPTY };
        }
        // The cap is about the mean direction that is stored. Where that has no positive length
        // there is no cap: the length of a spot that emits almost everywhere may round to zero or
        // below.
        let has_cap = length > 0.0 && !cone.is_full();
        let flux = flux.max(MIN_FLUX);
        Cluster {
            aabb: self.aabb(),
            flux,
            area_flux: if self.is_punctual() { 0.0 } else { flux },
            punctual_flux: if self.is_punctual() { flux } else { 0.0 },
            mean,
            variance,
            axis: cone.axis * length,
            cos_half_angle: if has_cap { cone.half_angle.cos() - CAP_PADDING } else { -1.0 },
            range: self.range,
        }
    }

    /// The effects of the light's kind; a dark light has them too.
    pub fn effects(&self) -> Effects {
        let kind = match self.shape {
            Shape::Point { .. } => Effects::empty(),
            Shape::Spot { .. } => Effects::CONES,
            Shape::Profile { .. } => PROFILE_EFFECTS,
            Shape::Sphere { .. } => Effects::AREAS,
            Shape::Rectangle { two_sided, .. } | Shape::Triangle { two_sided, .. } => {
                Effects::AREAS | if two_sided { Effects::empty() } else { Effects::CONES }
            }
        };
        if self.range < f32::INFINITY { kind | Effects::RANGES } else { kind }
    }

    /// Whether the light has no extent: a point, a spot or a profile.
    fn is_punctual(&self) -> bool {
        matches!(self.shape, Shape::Point { .. } | Shape::Spot { .. } | Shape::Profile { .. })
    }
}

/// A light at infinity, such as the moon. It belongs to no tree; a sampler chooses between it and
/// the trees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionalLight {
    /// Unit vector along which the light travels.
    pub direction: Vec3,
    /// Lux on a surface that faces it, linear Rec. 709.
    pub illuminance: Vec3,
}

impl DirectionalLight {
    /// Checks whether a world accepts this light.
    ///
    /// # Errors
    /// [`ValueError`] for the first number that is not allowed, as for [`Light::validate`].
    pub fn validate(&self) -> Result<(), ValueError> {
        check_direction("the length of direction", self.direction)?;
        let channels = ["illuminance.r", "illuminance.g", "illuminance.b"];
        channels
            .into_iter()
            .zip(self.illuminance.to_array())
            .try_for_each(|(what, value)| check_range(what, value, 0.0, MAX_EMISSION))
    }
}

/// The Rec. 709 luminance of a linear colour, in the unit of the colour.
pub fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Represents an unlimited range, in metres: shaders may not rely on infinity. Its square fits
/// into f32, and it is longer than any distance in a world.
pub(crate) const UNLIMITED_RANGE: f32 = 1.0e18;

/// The range window of KHR_lights_punctual: 1 at the light, exactly 0 from `range` on. 1 everywhere
/// for a range from [`UNLIMITED_RANGE`] on.
pub(crate) fn range_window(dist_sq: f32, range: f32) -> f32 {
    if range >= UNLIMITED_RANGE {
        return 1.0;
    }
    if dist_sq >= range * range {
        return 0.0;
    }
    let ratio_sq = dist_sq / (range * range);
    1.0 - ratio_sq * ratio_sq
}

/// Scale and offset of the spot falloff `clamp(cos * scale + offset, 0, 1)^2` of
/// KHR_lights_punctual.
pub(crate) fn spot_falloff(inner_angle: f32, outer_angle: f32) -> (f32, f32) {
    let cos_outer = outer_angle.cos();
    let scale = 1.0 / (inner_angle.cos() - cos_outer).max(MIN_SPOT_FALLOFF);
    (scale, -cos_outer * scale)
}

pub(crate) struct SpotLobe {
    /// The flux in lumens of a spot of one candela.
    pub solid_angle: f32,
    /// The length of its mean direction.
    pub mean_cosine: f32,
}

/// Integrals of the spot falloff over the sphere. With c the cosine of the angle to the axis, t =
/// (c - c_outer) scale runs from 0 to 1 over the falloff, and the falloff is t^2.
pub(crate) fn spot_lobe(inner_angle: f32, outer_angle: f32) -> SpotLobe {
    if outer_angle <= 0.0 {
        return SpotLobe { solid_angle: 0.0, mean_cosine: 1.0 };
    }
    let (scale, _) = spot_falloff(inner_angle, outer_angle);
    // 1 - cos without cancellation. Where the falloff is wider than the whole spot it is cut off at
    // c = 1.
    let one_minus_cos = 2.0 * (0.5 * outer_angle).sin().powi(2);
    let width = (1.0 / scale).min(one_minus_cos);
    let t = width * scale;
    let flat = (one_minus_cos - width).max(0.0);
    let integral = flat + width * t * t / 3.0;
    // First moment about c = 1, so that nothing cancels for narrow spots.
    let moment = flat * flat * 0.5 + t * t * (width * one_minus_cos / 3.0 - width * width / 4.0);
    SpotLobe { solid_angle: 2.0 * PI * integral, mean_cosine: (1.0 - moment / integral).clamp(-1.0, 1.0) }
}

fn sides(two_sided: bool) -> f64 {
    if two_sided { 2.0 } else { 1.0 }
}

/// The half space in front of a flat emitter; all directions if it is too thin or too small for an
/// exact normal.
fn half_space(u: Vec3, v: Vec3) -> Cone {
    let normal = u.cross(v);
    let is_thin = normal.length_squared() < MIN_SINE * MIN_SINE * u.length_squared() * v.length_squared();
    if is_thin || normal.abs().max_element() < MIN_CROSS {
        return Cone::FULL;
    }
    Cone { axis: normal.normalize(), half_angle: 0.5 * PI }
}

fn check_point(what: &'static str, p: Vec3) -> Result<(), ValueError> {
    p.to_array().into_iter().try_for_each(|value| check_range(what, value, -MAX_COORDINATE, MAX_COORDINATE))
}

fn check_direction(what: &'static str, d: Vec3) -> Result<(), ValueError> {
    check_unit(what, d.extend(0.0))
}

/// Checks that a vector is a unit vector. `what` names its length.
fn check_unit(what: &'static str, v: Vec4) -> Result<(), ValueError> {
    // In f64: the square of a tiny length would underflow, and the error shows the length. Of a vector that is
    // not finite the length is not either.
    check_range(what, v.as_dvec4().length() as f32, 1.0 - UNIT_TOLERANCE, 1.0 + UNIT_TOLERANCE)
}

#[cfg(test)]
mod tests;

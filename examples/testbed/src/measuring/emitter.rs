//! Lights and shading points in f32 or f64.
//!
//! In f32 all quantities have the bits of those of [`Light`]. In f64 they are those of a light that
//! was not rounded.

use super::real::{Real, Vector};
use girandole::cluster::Aabb;
use girandole::glam::{DVec3, Vec3};
use girandole::light::luminance;
use girandole::{Light, Profile, ShadingPoint, Shape};
use std::f64::consts::PI;

/// The greatest flux of a light, in lumens: see [`Light::flux`].
const MAX_FLUX: f64 = 1.0e34;
/// The least width of a spot's falloff, see [`Shape::Spot`].
const MIN_SPOT_FALLOFF: f64 = 1.0e-3;

/// [`Shape`] in another float.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form<R: Real> {
    Point { position: R::Vec3 },
    Spot { position: R::Vec3, direction: R::Vec3, inner_angle: R, outer_angle: R },
    Profile { position: R::Vec3, rotation: [f32; 4], profile: Profile },
    Rectangle { center: R::Vec3, half_u: R::Vec3, half_v: R::Vec3, two_sided: bool },
    Triangle { vertices: [R::Vec3; 3], two_sided: bool },
    Sphere { center: R::Vec3, radius: R },
}

/// [`Light`] in another float, without colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emitter<R: Real> {
    pub form: Form<R>,
    /// The luminance of the emission, in candela or nits.
    pub emission: R,
    /// In metres; infinity for no limit.
    pub range: R,
}

/// The position and the normal of a shading point in another float.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver<R: Real> {
    pub position: R::Vec3,
    /// A unit vector; zero in a volume.
    pub normal: R::Vec3,
}

/// [`Aabb`] in another float. It is never empty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RealAabb<R: Real> {
    pub min: R::Vec3,
    pub max: R::Vec3,
}

impl<R: Real> RealAabb<R> {
    /// The smallest box around at least one point.
    pub fn around(points: &[R::Vec3]) -> Self {
        let fold = |pick: fn(R::Vec3, R::Vec3) -> R::Vec3| points[1..].iter().fold(points[0], |a, b| pick(a, *b));
        Self { min: fold(R::Vec3::min), max: fold(R::Vec3::max) }
    }

    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    pub fn center(&self) -> R::Vec3 {
        (self.min + self.max) * R::of(0.5)
    }

    /// The edge lengths.
    pub fn extent(&self) -> R::Vec3 {
        self.max - self.min
    }
}

impl From<RealAabb<f32>> for Aabb {
    fn from(RealAabb { min, max }: RealAabb<f32>) -> Self {
        Self { min, max }
    }
}

impl<R: Real> Emitter<R> {
    /// The smallest box around all emitting points, in metres.
    pub fn aabb(&self) -> RealAabb<R> {
        match self.form {
            Form::Point { position } | Form::Spot { position, .. } | Form::Profile { position, .. } => {
                RealAabb { min: position, max: position }
            }
            Form::Rectangle { center, half_u, half_v, .. } => RealAabb::around(&[
                center - half_u - half_v,
                center - half_u + half_v,
                center + half_u - half_v,
                center + half_u + half_v,
            ]),
            Form::Triangle { vertices, .. } => RealAabb::around(&vertices),
            Form::Sphere { center, radius } => {
                let radius = R::Vec3::splat(radius);
                RealAabb { min: center - radius, max: center + radius }
            }
        }
    }

    /// The emitting area in square metres, both sides counted; 0 for lights without size.
    pub fn area(&self) -> R {
        R::of(self.wide_area())
    }

    /// In f64, as in [`Light::area`].
    fn wide_area(&self) -> f64 {
        let sides = |two_sided| if two_sided { 2.0 } else { 1.0 };
        let parallelogram = |u: R::Vec3, v: R::Vec3| u.as_dvec3().cross(v.as_dvec3()).length();
        match self.form {
            Form::Point { .. } | Form::Spot { .. } | Form::Profile { .. } => 0.0,
            Form::Rectangle { half_u, half_v, two_sided, .. } => 4.0 * parallelogram(half_u, half_v) * sides(two_sided),
            Form::Triangle { vertices: [a, b, c], two_sided } => 0.5 * parallelogram(b - a, c - a) * sides(two_sided),
            Form::Sphere { radius, .. } => {
                let radius: f64 = radius.into();
                4.0 * PI * radius.powi(2)
            }
        }
    }

    /// The emitted flux in lumens, see [`Light::flux`].
    pub fn flux(&self) -> R {
        match self.form {
            Form::Point { .. } => R::of(4.0) * R::PI() * self.emission,
            Form::Spot { inner_angle, outer_angle, .. } => self.emission * spot_solid_angle(inner_angle, outer_angle),
            Form::Profile { profile, .. } => self.emission * R::of(profile.flux().into()),
            _ => {
                let emission: f64 = self.emission.into();
                R::of((PI * emission * self.wide_area()).min(MAX_FLUX))
            }
        }
    }
}

/// The integral of the falloff of a spot over all directions.
fn spot_solid_angle<R: Real>(inner_angle: R, outer_angle: R) -> R {
    if outer_angle <= R::zero() {
        return R::zero();
    }
    let scale = R::one() / (inner_angle.cos() - outer_angle.cos()).max(R::of(MIN_SPOT_FALLOFF));
    let sine = (R::of(0.5) * outer_angle).sin();
    let one_minus_cos = R::of(2.0) * (sine * sine);
    let width = (R::one() / scale).min(one_minus_cos);
    let t = width * scale;
    let flat = (one_minus_cos - width).max(R::zero());
    R::of(2.0) * R::PI() * (flat + width * t * t / R::of(3.0))
}

impl Emitter<f64> {
    /// The light in f32, with a white emission.
    pub fn rounded(&self) -> Light {
        let near = |vector: DVec3| vector.as_vec3();
        let shape = match self.form {
            Form::Point { position } => Shape::Point { position: near(position) },
            Form::Spot { position, direction, inner_angle, outer_angle } => Shape::Spot {
                position: near(position),
                direction: near(direction),
                inner_angle: inner_angle as f32,
                outer_angle: outer_angle as f32,
            },
            Form::Profile { position, rotation, profile } => {
                Shape::Profile { position: near(position), rotation, profile }
            }
            Form::Rectangle { center, half_u, half_v, two_sided } => {
                Shape::Rectangle { center: near(center), half_u: near(half_u), half_v: near(half_v), two_sided }
            }
            Form::Triangle { vertices, two_sided } => Shape::Triangle { vertices: vertices.map(near), two_sided },
            Form::Sphere { center, radius } => Shape::Sphere { center: near(center), radius: radius as f32 },
        };
        Light::new(shape, Vec3::splat(self.emission as f32)).with_range(self.range as f32)
    }
}

impl<R: Real> From<&Light> for Emitter<R> {
    fn from(light: &Light) -> Self {
        let exact = |vector: Vec3| R::Vec3::of(vector.as_dvec3());
        let real = |value: f32| R::of(f64::from(value));
        let form = match light.shape {
            Shape::Point { position } => Form::Point { position: exact(position) },
            Shape::Spot { position, direction, inner_angle, outer_angle } => Form::Spot {
                position: exact(position),
                direction: exact(direction),
                inner_angle: real(inner_angle),
                outer_angle: real(outer_angle),
            },
            Shape::Profile { position, rotation, profile } => {
                Form::Profile { position: exact(position), rotation, profile }
            }
            Shape::Rectangle { center, half_u, half_v, two_sided } => {
                Form::Rectangle { center: exact(center), half_u: exact(half_u), half_v: exact(half_v), two_sided }
            }
            Shape::Triangle { vertices, two_sided } => Form::Triangle { vertices: vertices.map(exact), two_sided },
            Shape::Sphere { center, radius } => Form::Sphere { center: exact(center), radius: real(radius) },
            _ => unreachable!("this version has no others"),
        };
        Self { form, emission: real(luminance(light.emission)), range: real(light.range) }
    }
}

impl<R: Real> From<&ShadingPoint> for Receiver<R> {
    fn from(at: &ShadingPoint) -> Self {
        let exact = |vector: Vec3| R::Vec3::of(vector.as_dvec3());
        Self { position: exact(at.position), normal: exact(at.normal) }
    }
}

impl Receiver<f64> {
    /// A point on a surface in f32, relative to an origin.
    pub fn rounded(&self, origin: DVec3) -> ShadingPoint {
        ShadingPoint::surface((self.position - origin).as_vec3(), self.normal.as_vec3())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::split_mix::Rng;

    fn vector(rng: &mut Rng) -> Vec3 {
        Vec3::new(rng.between(-3.0, 3.0), rng.between(-3.0, 3.0), rng.between(-3.0, 3.0))
    }

    fn lights(rng: &mut Rng) -> [Light; 7] {
        let [p, u, v, emission] = [vector(rng), vector(rng), vector(rng), vector(rng).abs()];
        let outer_angle = rng.between(0.0, 3.1);
        let inner_angle = outer_angle * rng.unit();
        [
            Light::point(p, emission),
            Light::spot(p, u.normalize(), inner_angle, outer_angle, emission),
            Light::rectangle(p, u, v, emission),
            Light::rectangle(p, u, v, emission).two_sided(),
            Light::triangle([p, u, v], emission),
            Light::triangle([p, u, v], emission).two_sided(),
            Light::sphere(p, rng.unit(), emission),
        ]
    }

    #[test]
    fn emitters_in_f32_have_the_bits_of_lights_and_in_f64_their_values() {
        let mut rng = Rng(61);
        for light in (0..300).flat_map(|_| lights(&mut rng)) {
            let same: Emitter<f32> = (&light).into();
            assert_eq!(same.flux().to_bits(), light.flux().to_bits(), "{light:?}");
            assert_eq!(same.area(), light.area().unwrap_or(0.0), "{light:?}");
            assert_eq!(Aabb::from(same.aabb()), light.aabb(), "{light:?}");
            let wide: Emitter<f64> = (&light).into();
            // Rounding of f32, of a difference of cosines too: the flux of a narrow falloff.
            let [flux, exact] = [f64::from(light.flux()), wide.flux()];
            assert!((flux - exact).abs() <= 1.0e-3 * exact, "{light:?}: {flux} {exact}");
            assert_eq!(wide.rounded().shape, light.shape);
        }
    }
}

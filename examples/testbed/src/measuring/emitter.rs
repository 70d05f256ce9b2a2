//! Lights and shading points in f64, where those of [`Light`] were not rounded.

use girandole::glam::{DVec3, Vec3};
use girandole::light::luminance;
use girandole::{Light, Profile, ShadingPoint, Shape};

/// [`Shape`] in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    Point { position: DVec3 },
    Spot { position: DVec3, direction: DVec3, inner_angle: f64, outer_angle: f64 },
    Profile { position: DVec3, rotation: [f32; 4], profile: Profile },
    Rectangle { center: DVec3, half_u: DVec3, half_v: DVec3, two_sided: bool },
    Triangle { vertices: [DVec3; 3], two_sided: bool },
    Sphere { center: DVec3, radius: f64 },
}

/// [`Light`] in f64, without colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emitter {
    pub form: Form,
    /// The luminance of the emission, in candela or nits.
    pub emission: f64,
    /// In metres; infinity for no limit.
    pub range: f64,
}

/// The position and the normal of a shading point in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    pub position: DVec3,
    /// A unit vector; zero in a volume.
    pub normal: DVec3,
}

impl Emitter {
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

impl From<&Light> for Emitter {
    fn from(light: &Light) -> Self {
        let exact = |vector: Vec3| vector.as_dvec3();
        let form = match light.shape {
            Shape::Point { position } => Form::Point { position: exact(position) },
            Shape::Spot { position, direction, inner_angle, outer_angle } => Form::Spot {
                position: exact(position),
                direction: exact(direction),
                inner_angle: inner_angle.into(),
                outer_angle: outer_angle.into(),
            },
            Shape::Profile { position, rotation, profile } => {
                Form::Profile { position: exact(position), rotation, profile }
            }
            Shape::Rectangle { center, half_u, half_v, two_sided } => {
                Form::Rectangle { center: exact(center), half_u: exact(half_u), half_v: exact(half_v), two_sided }
            }
            Shape::Triangle { vertices, two_sided } => Form::Triangle { vertices: vertices.map(exact), two_sided },
            Shape::Sphere { center, radius } => Form::Sphere { center: exact(center), radius: radius.into() },
            _ => unreachable!("this version has no others"),
        };
        Self { form, emission: luminance(light.emission).into(), range: light.range.into() }
    }
}

impl From<&ShadingPoint> for Receiver {
    fn from(at: &ShadingPoint) -> Self {
        Self { position: at.position.as_dvec3(), normal: at.normal.as_dvec3() }
    }
}

impl Receiver {
    /// A point on a surface in f32, relative to an origin.
    pub fn rounded(&self, origin: DVec3) -> ShadingPoint {
        ShadingPoint::surface((self.position - origin).as_vec3(), self.normal.as_vec3())
    }
}

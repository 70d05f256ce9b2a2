//! Lights as plain values.

use girandole::{DirectionalLight, Light, Profile, Shape};

use crate::status::Failure;
use crate::vectors::{GirandoleVec3, GirandoleVec4, flag};

/// The kind of a light: one of GIRANDOLE_LIGHT_*.
pub type GirandoleLightKind = u32;
/// A point that emits equally in all directions. Emission in candela.
pub const GIRANDOLE_LIGHT_POINT: GirandoleLightKind = 0;
/// A point that emits into a cone, with the falloff of KHR_lights_punctual. Emission in candela.
pub const GIRANDOLE_LIGHT_SPOT: GirandoleLightKind = 1;
/// A parallelogram that emits evenly from the side to which half_u x half_v points. Emission in nits.
pub const GIRANDOLE_LIGHT_PARALLELOGRAM: GirandoleLightKind = 2;
/// A triangle that emits evenly from the side on which its vertices appear counter-clockwise. Emission in
/// nits.
pub const GIRANDOLE_LIGHT_TRIANGLE: GirandoleLightKind = 3;
/// A sphere that emits evenly outward. Emission in nits.
pub const GIRANDOLE_LIGHT_SPHERE: GirandoleLightKind = 4;
/// A point with a photometric profile. Emission as a factor of its candela.
pub const GIRANDOLE_LIGHT_PROFILE: GirandoleLightKind = 5;

/// The shape of a GIRANDOLE_LIGHT_POINT, in the space of its tree.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandolePointShape {
    /// Metres.
    pub position: GirandoleVec3,
}

/// The shape of a GIRANDOLE_LIGHT_SPOT, in the space of its tree.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleSpotShape {
    /// Metres.
    pub position: GirandoleVec3,
    /// The axis of the cone: a unit vector, to within 0.001.
    pub direction: GirandoleVec3,
    /// The angle from the axis up to which the intensity is full, in radians: 0 to outer_angle.
    pub inner_angle: f32,
    /// The angle from the axis at and beyond which the intensity is 0, in radians: 0 to pi.
    pub outer_angle: f32,
}

/// The shape of a GIRANDOLE_LIGHT_PARALLELOGRAM, in the space of its tree.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleParallelogramShape {
    /// Metres.
    pub center: GirandoleVec3,
    /// From the centre to the middle of one edge.
    pub half_u: GirandoleVec3,
    /// From the centre to the middle of the next edge.
    pub half_v: GirandoleVec3,
}

/// The shape of a GIRANDOLE_LIGHT_TRIANGLE, in the space of its tree.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleTriangleShape {
    /// Metres.
    pub vertices: [GirandoleVec3; 3],
}

/// The shape of a GIRANDOLE_LIGHT_SPHERE, in the space of its tree.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleSphereShape {
    /// Metres.
    pub center: GirandoleVec3,
    /// Metres, at least 0.
    pub radius: f32,
}

/// The shape of a GIRANDOLE_LIGHT_PROFILE, in the space of its tree.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleProfileShape {
    /// Metres.
    pub position: GirandoleVec3,
    /// The unit quaternion that turns the lamp. Before, it points along -Z, with the plane C0
    /// along +X.
    pub rotation: GirandoleVec4,
    /// The profile: see girandole_profile_from_ies.
    pub profile: u64,
}

/// The shape of a light. The kind of the light decides which member is used.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs, reason = "named after the kinds")]
pub union GirandoleShape {
    pub point: GirandolePointShape,
    pub spot: GirandoleSpotShape,
    pub parallelogram: GirandoleParallelogramShape,
    pub triangle: GirandoleTriangleShape,
    pub sphere: GirandoleSphereShape,
    pub profile: GirandoleProfileShape,
}

/// A light. The functions girandole_point_light to girandole_sphere_light make one.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct GirandoleLight {
    /// One of GIRANDOLE_LIGHT_*.
    pub kind: GirandoleLightKind,
    /// 1 if a parallelogram or triangle emits from its back too, else 0. Other kinds ignore it.
    pub two_sided: u32,
    /// Linear Rec. 709, in candela for points and spots, a factor for profiles and in nits for the others; 0 to
    /// 1e15.
    pub emission: GirandoleVec3,
    /// The distance in metres at and beyond which the light is exactly 0. Above 0; INFINITY for no limit.
    pub range: f32,
    /// The member that the kind names.
    pub shape: GirandoleShape,
}

impl std::fmt::Debug for GirandoleShape {
    /// Which member counts is not known here.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GirandoleShape").finish_non_exhaustive()
    }
}

impl std::fmt::Debug for GirandoleLight {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GirandoleLight").field("kind", &self.kind).finish_non_exhaustive()
    }
}

/// Checks the kind only; the library checks the numbers.
pub(crate) fn light(light: &GirandoleLight) -> Result<Light, Failure> {
    // Read for the kinds that have it only, since others may leave it undefined.
    let two_sided = || flag(light.two_sided, "two_sided");
    let shape = light.shape;
    // SAFETY: all members consist of numbers alone, and the caller has filled the one that the kind names.
    let shape = unsafe {
        match light.kind {
            GIRANDOLE_LIGHT_POINT => Shape::Point { position: shape.point.position.into() },
            GIRANDOLE_LIGHT_SPOT => Shape::Spot {
                position: shape.spot.position.into(),
                direction: shape.spot.direction.into(),
                inner_angle: shape.spot.inner_angle,
                outer_angle: shape.spot.outer_angle,
            },
            GIRANDOLE_LIGHT_PARALLELOGRAM => Shape::Rectangle {
                center: shape.parallelogram.center.into(),
                half_u: shape.parallelogram.half_u.into(),
                half_v: shape.parallelogram.half_v.into(),
                two_sided: two_sided()?,
            },
            GIRANDOLE_LIGHT_TRIANGLE => {
                Shape::Triangle { vertices: shape.triangle.vertices.map(Into::into), two_sided: two_sided()? }
            }
            GIRANDOLE_LIGHT_SPHERE => Shape::Sphere { center: shape.sphere.center.into(), radius: shape.sphere.radius },
            GIRANDOLE_LIGHT_PROFILE => Shape::Profile {
                position: shape.profile.position.into(),
                rotation: shape.profile.rotation.into(),
                profile: Profile::of_id(shape.profile.profile)
                    .ok_or_else(|| Failure::bad_value("profile", shape.profile.profile))?,
            },
            other => return Err(Failure::bad_value("kind of light", other)),
        }
    };
    Ok(Light::new(shape, light.emission.into()).with_range(light.range))
}

/// The lights of a list; the message of a refusal names the index.
pub(crate) fn lights(list: &[GirandoleLight]) -> Result<Vec<Light>, Failure> {
    let named = |(index, given)| {
        let name = |failure: Failure| Failure { message: format!("light {index}: {}", failure.message), ..failure };
        light(given).map_err(name)
    };
    list.iter().enumerate().map(named).collect()
}

fn unlimited(kind: GirandoleLightKind, shape: GirandoleShape, emission: GirandoleVec3) -> GirandoleLight {
    GirandoleLight { kind, two_sided: 0, emission, range: f32::INFINITY, shape }
}

/// Returns a point light without a range. candela: intensity per channel. Checks nothing.
#[unsafe(no_mangle)]
pub extern "C" fn girandole_point_light(position: GirandoleVec3, candela: GirandoleVec3) -> GirandoleLight {
    unlimited(GIRANDOLE_LIGHT_POINT, GirandoleShape { point: GirandolePointShape { position } }, candela)
}

/// Returns a spot light without a range. direction: unit vector; angles in radians from it. Checks nothing.
#[unsafe(no_mangle)]
pub extern "C" fn girandole_spot_light(
    position: GirandoleVec3,
    direction: GirandoleVec3,
    inner_angle: f32,
    outer_angle: f32,
    candela: GirandoleVec3,
) -> GirandoleLight {
    let spot = GirandoleSpotShape { position, direction, inner_angle, outer_angle };
    unlimited(GIRANDOLE_LIGHT_SPOT, GirandoleShape { spot }, candela)
}

/// Returns a one-sided parallelogram with the edges 2 * half_u and 2 * half_v. nits: radiance per channel.
/// Checks nothing.
#[unsafe(no_mangle)]
pub extern "C" fn girandole_parallelogram_light(
    center: GirandoleVec3,
    half_u: GirandoleVec3,
    half_v: GirandoleVec3,
    nits: GirandoleVec3,
) -> GirandoleLight {
    let parallelogram = GirandoleParallelogramShape { center, half_u, half_v };
    unlimited(GIRANDOLE_LIGHT_PARALLELOGRAM, GirandoleShape { parallelogram }, nits)
}

/// Returns a one-sided triangle. nits: radiance per channel. Checks nothing.
#[unsafe(no_mangle)]
pub extern "C" fn girandole_triangle_light(
    a: GirandoleVec3,
    b: GirandoleVec3,
    c: GirandoleVec3,
    nits: GirandoleVec3,
) -> GirandoleLight {
    let triangle = GirandoleTriangleShape { vertices: [a, b, c] };
    unlimited(GIRANDOLE_LIGHT_TRIANGLE, GirandoleShape { triangle }, nits)
}

/// Returns a sphere. radius in metres. nits: radiance per channel. Checks nothing.
#[unsafe(no_mangle)]
pub extern "C" fn girandole_sphere_light(center: GirandoleVec3, radius: f32, nits: GirandoleVec3) -> GirandoleLight {
    unlimited(GIRANDOLE_LIGHT_SPHERE, GirandoleShape { sphere: GirandoleSphereShape { center, radius } }, nits)
}

/// Returns a point light with a profile. rotation: unit quaternion. factor: of the candela of the
/// profile, per channel. Checks nothing.
#[unsafe(no_mangle)]
pub extern "C" fn girandole_profile_light(
    position: GirandoleVec3,
    rotation: GirandoleVec4,
    profile: u64,
    factor: GirandoleVec3,
) -> GirandoleLight {
    let profile = GirandoleProfileShape { position, rotation, profile };
    unlimited(GIRANDOLE_LIGHT_PROFILE, GirandoleShape { profile }, factor)
}

/// A light at infinity, such as the moon.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleDirectionalLight {
    /// Unit vector along which the light travels.
    pub direction: GirandoleVec3,
    /// Lux on a surface that faces it, linear Rec. 709.
    pub illuminance: GirandoleVec3,
}

impl From<&GirandoleDirectionalLight> for DirectionalLight {
    fn from(light: &GirandoleDirectionalLight) -> Self {
        Self { direction: light.direction.into(), illuminance: light.illuminance.into() }
    }
}

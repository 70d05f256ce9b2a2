//! Shading points as plain values.

use girandole::glam::Vec3;
use girandole::{Gloss, ShadingPoint};

use crate::status::Failure;
use crate::vectors::{GirandoleVec3, flag};

/// What a light is chosen for: a point on a surface, a point in a volume, or a segment of a ray. The
/// functions girandole_surface_point, girandole_volume_point and girandole_segment make one.
///
/// Numbers that are not finite are allowed: such a point counts as far from all lights.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleShadingPoint {
    /// Metres, relative to the world's origin; for a segment, its middle.
    pub position: GirandoleVec3,
    /// Unit normal of the side that is shaded; zero for a point in a volume and for a segment.
    pub normal: GirandoleVec3,
    /// From the start of a segment to its end, in metres; zero for a point.
    pub segment: GirandoleVec3,
    /// Only lights of instances whose mask shares a bit with this mask reach the point. All bits by default.
    pub mask: u32,
    /// 1 if the surface is glossy, else 0. The following four fields are used only if it is 1.
    pub is_glossy: u32,
    /// The direction to the viewer. Need not be of unit length.
    pub view: GirandoleVec3,
    /// Perceptual roughness, whose square is the alpha of GGX.
    pub roughness: f32,
    /// Specular reflectance at normal incidence.
    pub specular: f32,
    /// Diffuse reflectance.
    pub diffuse: f32,
}

impl From<ShadingPoint> for GirandoleShadingPoint {
    fn from(point: ShadingPoint) -> Self {
        let none = Gloss { view: Vec3::ZERO, roughness: 0.0, specular: 0.0, diffuse: 0.0 };
        let gloss = point.gloss.unwrap_or(none);
        Self {
            position: point.position.into(),
            normal: point.normal.into(),
            segment: point.segment.into(),
            mask: point.mask,
            is_glossy: u32::from(point.gloss.is_some()),
            view: gloss.view.into(),
            roughness: gloss.roughness,
            specular: gloss.specular,
            diffuse: gloss.diffuse,
        }
    }
}

pub(crate) fn shading_point(given: &GirandoleShadingPoint) -> Result<ShadingPoint, Failure> {
    let mut point = ShadingPoint::surface(given.position.into(), given.normal.into());
    point.segment = given.segment.into();
    point.mask = given.mask;
    if flag(given.is_glossy, "is_glossy")? {
        // Read here only, since the fields of other points may be undefined.
        let GirandoleShadingPoint { view, roughness, specular, diffuse, .. } = *given;
        point.gloss = Some(Gloss { view: view.into(), roughness, specular, diffuse });
    }
    Ok(point)
}

/// Returns a point on a matte surface. normal: unit vector to the side that is shaded. Checks nothing.
#[unsafe(no_mangle)]
pub extern "C" fn girandole_surface_point(position: GirandoleVec3, normal: GirandoleVec3) -> GirandoleShadingPoint {
    ShadingPoint::surface(position.into(), normal.into()).into()
}

/// Returns a point in a volume, which light may reach from all sides. Checks nothing.
#[unsafe(no_mangle)]
pub extern "C" fn girandole_volume_point(position: GirandoleVec3) -> GirandoleShadingPoint {
    ShadingPoint::volume(position.into()).into()
}

/// Returns the segment of a ray from start along direction, a unit vector, of a length in metres. Checks
/// nothing.
#[unsafe(no_mangle)]
pub extern "C" fn girandole_segment(
    start: GirandoleVec3,
    direction: GirandoleVec3,
    length: f32,
) -> GirandoleShadingPoint {
    ShadingPoint::segment(start.into(), direction.into(), length).into()
}

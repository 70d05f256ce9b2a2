//! Vectors, and numbers that are 0 or 1.

use girandole::glam::{DVec3, Vec2, Vec3};

use crate::status::Failure;

/// Two numbers, such as texture coordinates.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(missing_docs, reason = "coordinates")]
pub struct GirandoleVec2 {
    pub x: f32,
    pub y: f32,
}

impl From<GirandoleVec2> for Vec2 {
    fn from(v: GirandoleVec2) -> Self {
        Self::new(v.x, v.y)
    }
}

impl From<Vec2> for GirandoleVec2 {
    fn from(v: Vec2) -> Self {
        Self { x: v.x, y: v.y }
    }
}

/// Three numbers: a position or vector in metres, or a colour in linear Rec. 709.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(missing_docs, reason = "coordinates")]
pub struct GirandoleVec3 {
    pub x: f32,
    pub y: f32,
    pub z: f32,
}

impl From<GirandoleVec3> for Vec3 {
    fn from(v: GirandoleVec3) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

impl From<Vec3> for GirandoleVec3 {
    fn from(v: Vec3) -> Self {
        Self { x: v.x, y: v.y, z: v.z }
    }
}

/// Four numbers, such as a quaternion.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(missing_docs, reason = "coordinates")]
pub struct GirandoleVec4 {
    pub x: f32,
    pub y: f32,
    pub z: f32,
    pub w: f32,
}

impl From<GirandoleVec4> for [f32; 4] {
    fn from(v: GirandoleVec4) -> Self {
        [v.x, v.y, v.z, v.w]
    }
}

/// A position or vector of the world in double precision, in metres.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(missing_docs, reason = "coordinates")]
pub struct GirandoleDVec3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

impl From<GirandoleDVec3> for DVec3 {
    fn from(v: GirandoleDVec3) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

impl From<DVec3> for GirandoleDVec3 {
    fn from(v: DVec3) -> Self {
        Self { x: v.x, y: v.y, z: v.z }
    }
}

/// A number that is 0 or 1.
pub(crate) fn flag(number: u32, what: &str) -> Result<bool, Failure> {
    match number {
        0 => Ok(false),
        1 => Ok(true),
        other => Err(Failure::bad_value(&format!("value of {what}, which is 0 or 1"), other)),
    }
}

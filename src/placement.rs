//! Where an instance stands: a linear part in f32 and a translation in f64, so that a centimetre counts 10^7 m out.

use glam::{Affine3A, DAffine3, DVec3, Mat3, Mat4, Vec3};

use crate::cluster::{Linear, RIGID_TOLERANCE};
use crate::effects::Effects;
use crate::error::PlacementError;
use crate::importance::{LocalShadingPoint, POSITION_MARGIN};
use crate::shading_point::ShadingPoint;
use crate::transform::InstanceTransform;

/// Farthest an instance may stand from the world's origin, per axis, in metres.
pub const MAX_DISTANCE: f64 = 1.0e9;

/// Largest entry of a linear part, and the inverse of the least scale: squares of cofactors stay inside f32.
pub const MAX_SCALE: f32 = 1.0e9;

/// A rotation, scale, mirror or shear, and a place. From tree space to the world.
///
/// Points and spots keep their intensity and range whatever the scale, as glTF has it; surfaces keep their radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Columns are the images of the axes; any matrix with an inverse.
    pub linear: Mat3,
    /// Metres.
    pub translation: DVec3,
}

impl Placement {
    /// Tree space is the world.
    pub const IDENTITY: Self = Self { linear: Mat3::IDENTITY, translation: DVec3::ZERO };

    /// Moves only.
    pub fn at(translation: DVec3) -> Self {
        Self { translation, ..Self::IDENTITY }
    }
}

impl Default for Placement {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl From<Affine3A> for Placement {
    fn from(a: Affine3A) -> Self {
        Self { linear: a.matrix3.into(), translation: Vec3::from(a.translation).as_dvec3() }
    }
}

impl From<Mat4> for Placement {
    fn from(m: Mat4) -> Self {
        Self { linear: Mat3::from_mat4(m), translation: m.w_axis.truncate().as_dvec3() }
    }
}

impl From<DAffine3> for Placement {
    fn from(a: DAffine3) -> Self {
        Self { linear: a.matrix3.as_mat3(), translation: a.translation }
    }
}

/// A placement relative to the world's origin, with what sampling needs of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    pub linear: Linear,
    pub frame: InstanceTransform,
}

impl Placed {
    /// Checks a placement and derives the rest.
    pub fn new(placement: &Placement, origin: DVec3) -> Result<Self, PlacementError> {
        let entries = placement.linear.to_cols_array();
        if let Some(value) = entries.into_iter().find(|e| !e.is_finite()) {
            return Err(PlacementError::NotFinite { what: "an entry of the linear part", value: value.into() });
        }
        if let Some(value) = entries.into_iter().find(|e| e.abs() > MAX_SCALE) {
            return Err(PlacementError::TooLarge { value, limit: MAX_SCALE });
        }
        if let Some(value) = placement.translation.to_array().into_iter().find(|e| !e.is_finite()) {
            return Err(PlacementError::NotFinite { what: "a coordinate of the translation", value });
        }
        let offset = placement.translation - origin;
        let distance = offset.abs().max_element();
        if distance > MAX_DISTANCE {
            return Err(PlacementError::TooFar { distance, limit: MAX_DISTANCE });
        }
        let linear = Linear::new(placement.linear);
        let to_local = placement.linear.as_dmat3().inverse().as_mat3();
        // Normal numbers only: a denormal determinant has lost the digits that its inverse needs.
        if !(linear.determinant.is_normal() && to_local.is_finite() && linear.least_scale >= 1.0 / MAX_SCALE) {
            return Err(PlacementError::Singular { determinant: linear.determinant });
        }
        let frame = InstanceTransform {
            to_world: placement.linear,
            translation: offset.as_vec3(),
            to_local,
            determinant: linear.determinant,
        };
        Ok(Self { linear, frame })
    }

    /// What an instance that stands here calls for.
    pub fn effects(&self) -> Effects {
        if self.linear.is_rigid() { Effects::empty() } else { Effects::NON_RIGID }
    }

    /// A shading point of the world in the tree's space.
    pub fn local_shading_point(&self, shading_point: &ShadingPoint) -> LocalShadingPoint {
        // Normals are carried back by the transpose: the horizon stays the horizon under any linear map.
        let normal = (self.linear.linear.transpose() * shading_point.normal).normalize_or_zero();
        LocalShadingPoint {
            position: self.frame.to_local * (shading_point.position - self.frame.translation),
            normal,
            has_normal: normal != Vec3::ZERO,
            range_scale: self.range_scale(),
            margin: POSITION_MARGIN * (self.linear.mean_square_scale.sqrt() * self.range_scale()).max(1.0)
                + RIGID_TOLERANCE,
            keeps_angles: self.linear.is_similarity,
        }
    }

    /// Metres of tree space per metre of the world, at most.
    pub fn range_scale(&self) -> f32 {
        1.0 / self.linear.least_scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placements_that_flatten_space_or_leave_it_are_refused() {
        let flat = Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, 0.0, 1.0)), ..Placement::IDENTITY };
        assert!(matches!(Placed::new(&flat, DVec3::ZERO), Err(PlacementError::Singular { .. })));
        let scaled = |s| Placement { linear: Mat3::from_diagonal(Vec3::splat(s)), ..Placement::IDENTITY };
        assert!(
            Placed::new(&scaled(MAX_SCALE), DVec3::ZERO).is_ok_and(|p| p.linear.flux(1.0, 1.0, Vec3::X).is_finite())
        );
        assert!(matches!(Placed::new(&scaled(MAX_SCALE.next_up()), DVec3::ZERO), Err(PlacementError::TooLarge { .. })));
        assert!(Placed::new(&scaled(1.001 / MAX_SCALE), DVec3::ZERO).is_ok_and(|p| p.linear.is_similarity));
        assert!(matches!(Placed::new(&scaled(0.9 / MAX_SCALE), DVec3::ZERO), Err(PlacementError::Singular { .. })));
        let nan = Placement::at(DVec3::new(0.0, f64::NAN, 0.0));
        assert!(matches!(Placed::new(&nan, DVec3::ZERO), Err(PlacementError::NotFinite { .. })));
        let limit = Placement::at(DVec3::X * MAX_DISTANCE);
        assert!(Placed::new(&limit, DVec3::ZERO).is_ok());
        let past = Placement::at(DVec3::X * MAX_DISTANCE.next_up());
        assert!(matches!(Placed::new(&past, DVec3::ZERO), Err(PlacementError::TooFar { .. })));
        assert!(Placed::new(&past, DVec3::X).is_ok());
    }

    #[test]
    fn centimetres_survive_ten_thousand_kilometres_out() {
        let origin = DVec3::new(1.0e7, 0.0, -1.0e7);
        let placed = Placed::new(&Placement::at(origin + DVec3::new(0.01, 0.0, 0.0)), origin).unwrap();
        assert_eq!(placed.frame.translation, Vec3::new(0.01, 0.0, 0.0));
    }
}

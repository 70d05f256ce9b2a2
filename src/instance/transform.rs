//! The map between a tree's space and the world that an instance stands for.

use glam::{Mat3, Vec3};

use crate::shading::shading_point::ShadingPoint;

/// An affine map from a tree's space to the world (relative to its origin), and the linear part of
/// its inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct InstanceTransform {
    pub to_world: Mat3,
    pub translation: Vec3,
    pub to_local: Mat3,
    pub determinant: f32,
}

impl InstanceTransform {
    /// The vector in the world from a shading point to a point of the tree's space.
    ///
    /// The translations are subtracted first. So a light and a shading point that are close to each
    /// other and far from the origin keep their digits, and the vector agrees with the bounds that
    /// the walk tests.
    pub fn toward(&self, p: Vec3, shading_point: &ShadingPoint) -> Vec3 {
        self.to_world * p + (self.translation - shading_point.position)
    }

    /// A shading point in the tree's space.
    pub fn in_tree(&self, shading_point: &ShadingPoint) -> Vec3 {
        self.to_local * (shading_point.position - self.translation)
    }

    /// A normal times an area, transformed by the matrix of cofactors. The cross product of the
    /// transformed edges would not do: for a sliver it may round to another side than the light's
    /// cap.
    pub fn normal_area(&self, normal_area: Vec3) -> Vec3 {
        self.to_local.transpose() * normal_area * self.determinant.abs()
    }
}

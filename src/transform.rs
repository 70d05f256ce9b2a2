//! How an instance carries its tree's space to the world.

use glam::{Mat3, Vec3};

use crate::shading_point::ShadingPoint;

/// How an instance places its lights: to the world (relative to its origin) and back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct InstanceTransform {
    pub to_world: Mat3,
    pub translation: Vec3,
    pub to_local: Mat3,
    pub determinant: f32,
}

impl InstanceTransform {
    /// From a shading point to a place in tree space. The translations first: what is near each other far from the origin
    /// keeps its digits, and lies where the walk's bounds see it.
    pub fn toward(&self, p: Vec3, shading_point: &ShadingPoint) -> Vec3 {
        self.to_world * p + (self.translation - shading_point.position)
    }

    /// A normal times an area, carried along by the cofactors. Not a cross product of carried edges: a sliver's would
    /// round to another side than its cap.
    pub fn normal_area(&self, normal_area: Vec3) -> Vec3 {
        self.to_local.transpose() * normal_area * self.determinant.abs()
    }
}

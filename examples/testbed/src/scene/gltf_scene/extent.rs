//! Where the geometry of a scene lies.

use girandole::glam::Vec3;

use super::{Object, Scene};

/// The corners of all visible triangles, in world space.
pub fn vertices(scene: &Scene) -> impl Iterator<Item = Vec3> {
    let is_shown = |object: &&Object| object.visible && object.transform.matrix3.determinant() != 0.0;
    scene.objects.iter().filter(is_shown).flat_map(|object| {
        let corners = scene.meshes[object.mesh as usize].triangles.iter().flat_map(|triangle| triangle.vertices);
        corners.map(|vertex| object.transform.transform_point3(vertex))
    })
}

/// The box of all visible triangles, in world space.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Lower corner.
    pub low: Vec3,
    /// Upper corner.
    pub high: Vec3,
}

impl Extent {
    /// The box of a scene with at least one triangle. It is a point at the origin if all are hidden.
    pub fn of(scene: &Scene) -> Self {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for vertex in vertices(scene) {
            (low, high) = (low.min(vertex), high.max(vertex));
        }
        if low.cmple(high).all() { Self { low, high } } else { Self { low: Vec3::ZERO, high: Vec3::ZERO } }
    }

    /// The length of its diagonal, metres; at least 1 mm.
    pub fn size(&self) -> f32 {
        self.low.distance(self.high).max(1e-3)
    }

    /// Its middle.
    pub fn middle(&self) -> Vec3 {
        self.low + (self.high - self.low) * 0.5
    }
}

//! Finds shading points: the first surfaces that rays from the camera or from lights meet.

use girandole::ShadingPoint;
use girandole::cluster::Aabb;
use girandole::glam::{Affine3A, Mat3, Vec3};
use testbed::scene::{Camera, Object, Scene};

/// The distance of shading points from their surface, in metres.
const OFFSET: f32 = 1.0e-3;

/// The visible objects of a scene, each in its box. A few dozen rays do not need a better
/// structure.
pub struct Rays<'a> {
    scene: &'a Scene,
    /// The box in world space, the mesh, and the transform from the world to the mesh.
    objects: Vec<(Aabb, u32, Affine3A)>,
}

impl<'a> Rays<'a> {
    /// Computes the boxes: O(triangles of all meshes + objects).
    pub fn new(scene: &'a Scene) -> Self {
        let boxes: Vec<Aabb> =
            scene.meshes.iter().map(|mesh| Aabb::around(mesh.triangles.iter().flat_map(|t| t.vertices))).collect();
        let visible = scene.objects.iter().filter(|object| object.visible);
        let object = |object: &Object| {
            let transform = object.transform;
            let aabb = boxes[object.mesh as usize].transformed(&transform.matrix3.into(), transform.translation.into());
            (aabb, object.mesh, transform.inverse())
        };
        Self { scene, objects: visible.map(object).collect() }
    }

    /// The first surface within `reach` metres, as a shading point on the side of the ray's origin.
    pub fn first(&self, from: Vec3, direction: Vec3, reach: f32) -> Option<ShadingPoint> {
        let mut nearest = reach;
        let mut found = None;
        for (aabb, mesh, to_mesh) in &self.objects {
            if !meets(aabb, from, direction, nearest) {
                continue;
            }
            let (start, way) = (to_mesh.transform_point3(from), to_mesh.transform_vector3(direction));
            for triangle in &self.scene.meshes[*mesh as usize].triangles {
                if let Some(distance) = distance(triangle.vertices, start, way).filter(|d| *d < nearest) {
                    nearest = distance;
                    found = Some((triangle.vertices, to_mesh));
                }
            }
        }
        let ([a, b, c], to_mesh) = found?;
        let local = (b - a).cross(c - a);
        // Normals transform by the inverse transpose; `to_mesh` is the inverse.
        let normal = (Mat3::from(to_mesh.matrix3).transpose() * local).try_normalize()?;
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        Some(ShadingPoint::surface(from + direction * nearest + normal * OFFSET, normal))
    }
}

/// The direction of the camera ray at `u` in [0, 1)^2, for pictures of 16:9.
pub fn through(camera: &Camera, u: [f32; 2]) -> Vec3 {
    let forward = (camera.target - camera.eye).normalize_or(Vec3::NEG_Z);
    let right = forward.cross(Vec3::Y).normalize_or(Vec3::X);
    let up = right.cross(forward);
    let half = (0.5 * camera.vertical_fov).tan();
    let [x, y] = u.map(|u| 2.0 * u - 1.0);
    (forward + right * (x * half * 16.0 / 9.0) + up * (y * half)).normalize()
}

/// Whether a ray meets a box within `reach`.
fn meets(aabb: &Aabb, from: Vec3, direction: Vec3, reach: f32) -> bool {
    let (a, b) = ((aabb.min - from) / direction, (aabb.max - from) / direction);
    let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
    enter <= leave && leave > 0.0 && enter < reach
}

/// The distance to a triangle along a ray (Möller and Trumbore 1997).
fn distance([a, b, c]: [Vec3; 3], from: Vec3, direction: Vec3) -> Option<f32> {
    let (ab, ac, to) = (b - a, c - a, from - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    let q = to.cross(ab);
    let (u, v) = (to.dot(p) / determinant, direction.dot(q) / determinant);
    let distance = ac.dot(q) / determinant;
    (determinant != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 1.0e-3).then_some(distance)
}

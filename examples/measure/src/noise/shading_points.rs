//! Shading points on the surfaces of a scene: random, uniform in area, and the same in every run.

use girandole::ShadingPoint;
use girandole::cluster::Aabb;
use girandole::glam::Vec3;
use testbed::scene::rng::Rng;
use testbed::scene::{Scene, SceneError};

/// The distance of shading points from their surface, in metres.
const OFFSET: f32 = 1.0e-3;
/// Seeds the positions.
const SEED: u64 = 12_345;
/// Tries per shading point, after which the bounds count as empty.
const TRIES: usize = 10_000;

/// Finds `count` points on visible surfaces within `bounds`, each with the normal of its triangle's
/// front.
pub fn shading_points(scene: &Scene, bounds: &Aabb, count: usize) -> Result<Vec<ShadingPoint>, SceneError> {
    let mut triangles: Vec<(f64, [Vec3; 3])> = Vec::new();
    let mut area = 0.0;
    for object in scene.objects.iter().filter(|object| object.visible) {
        for triangle in &scene.meshes[object.mesh as usize].triangles {
            let [a, b, c] = triangle.vertices.map(|vertex| object.transform.transform_point3(vertex));
            if !bounds.intersection(&Aabb::around([a, b, c])).is_empty() {
                area += f64::from((b - a).cross(c - a).length());
                triangles.push((area, [a, b, c]));
            }
        }
    }
    let mut rng = Rng::new(SEED, 0);
    let mut found = Vec::with_capacity(count);
    for _ in 0..count * TRIES {
        if found.len() == count || triangles.is_empty() {
            break;
        }
        // Two numbers of 24 bits: one alone would miss most triangles of a scene with millions.
        let target = (f64::from(rng.unit()) + f64::from(rng.unit()) / f64::from(1 << 24)) * area;
        let index = triangles.partition_point(|(end, _)| *end <= target).min(triangles.len() - 1);
        let [a, b, c] = triangles[index].1;
        let (root, v) = (rng.unit().sqrt(), rng.unit());
        let position = a * (1.0 - root) + b * (root * (1.0 - v)) + c * (root * v);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        if normal != Vec3::ZERO && bounds.contains(&Aabb::point(position)) {
            found.push(ShadingPoint::surface(position + normal * OFFSET, normal));
        }
    }
    let is_complete = found.len() == count;
    is_complete.then_some(found).ok_or_else(|| SceneError("the scene has too few surfaces for shading points".into()))
}

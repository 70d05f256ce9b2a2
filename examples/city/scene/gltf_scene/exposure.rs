//! Finds an exposure for what the camera sees.

use std::f32::consts::PI;

use girandole::glam::{Vec3, vec3};
use girandole::{LightWorld, ShadingPoint};

use super::Scene;
use super::rng::Rng;

/// An exposure that maps the geometric mean of the reflected radiance near the camera, without
/// shadows, to 0.1.
pub fn exposure(scene: &Scene, world: &LightWorld) -> f32 {
    let sampler = world.sampler();
    let mut rng = Rng::new(1, 0xe5b0);
    let camera = &scene.camera;
    let forward = (camera.target - camera.eye).normalize_or(Vec3::NEG_Z);
    // The triangles in view within 80 m. All have the same weight, so that dense geometry counts
    // more.
    let triangles: Vec<([Vec3; 3], u32)> = scene
        .objects
        .iter()
        .flat_map(|object| {
            let mesh = &scene.meshes[object.mesh as usize];
            mesh.triangles.iter().map(|t| (t.vertices.map(|v| object.transform.transform_point3(v)), t.material))
        })
        .filter(|(t, _)| {
            let to = t[0] - camera.eye;
            to.dot(forward) > 0.7 * to.length() && to.length() < 80.0
        })
        .collect();
    let (mut sum, mut count) = (0.0, 0);
    for _ in 0..2000.min(triangles.len() * 4) {
        let ([a, b, c], material) = triangles[rng.below(triangles.len())];
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        let position = (a + b + c) / 3.0;
        let normal = if normal.dot(camera.eye - position) < 0.0 { -normal } else { normal };
        let shading_point = ShadingPoint::surface(position + normal * 1e-3, normal);
        let samples = 4;
        let mut light = 0.0;
        for _ in 0..samples {
            let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
            let Some(sample) = sampler.sample(&shading_point, u) else { continue };
            let incident = sample.incident;
            let arriving = incident.radiance * (incident.direction.dot(normal).max(0.0) / (sample.pmf * incident.pdf));
            light += arriving.dot(vec3(0.2126, 0.7152, 0.0722)) / samples as f32;
        }
        let albedo = scene.materials[material as usize].base_color.element_sum() / 3.0;
        let reflected = albedo / PI * light + albedo * scene.sky.ambient.y;
        if reflected.is_finite() && reflected > 1e-9 {
            sum += reflected.ln();
            count += 1;
        }
    }
    if count == 0 { 1.0 } else { (0.1 / (sum / count as f32).exp()).clamp(1e-6, 1e6) }
}

//! Finds an exposure for what the camera sees.

use std::f32::consts::PI;

use girandole::glam::{Vec3, vec3};
use girandole::{LightSampler, LightWorld, ShadingPoint};

use super::rng::Rng;
use super::{Material, Scene};

/// Triangles within this distance of the camera count, metres.
const REACH: f32 = 80.0;
/// If the nearest triangle is farther, those within this multiple of its distance count.
const FAR_REACH: f32 = 3.0;
/// What the mean reflected radiance is mapped to.
const REFLECTED: f32 = 0.1;
/// What the mean emitted radiance is mapped to, in scenes with little else.
const EMITTED: f32 = 0.5;
/// Share of the triangles in view up to which surfaces that do not emit are ignored.
const FEW: f32 = 0.05;

/// An exposure that maps the geometric mean of the reflected radiance near the camera, without
/// shadows, to 0.1. Where almost all surfaces emit, their mean emission is mapped to 0.5.
pub fn exposure(scene: &Scene, world: &LightWorld) -> f32 {
    let sampler = world.sampler();
    let mut rng = Rng::new(1, 0xe5b0);
    let triangles = in_view(scene);
    let (mut reflected, mut emitted) = (LogMean::default(), LogMean::default());
    let (mut plain, mut count) = (0, 0);
    for _ in 0..2000.min(triangles.len() * 4) {
        let ([a, b, c], material, tint) = triangles[rng.below(triangles.len())];
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        let material = mean_material(scene, &scene.materials[material as usize]);
        if material.unlit > 0.0 {
            continue;
        }
        let position = (a + b + c) / 3.0;
        let normal = if normal.dot(scene.camera.eye - position) < 0.0 { -normal } else { normal };
        // Off the surface, by more than the rounding of its position.
        let offset = normal * (1e-3f32).max(position.abs().max_element() * 1e-6);
        let light = illuminance(&sampler, &ShadingPoint::surface(position + offset, normal), &mut rng);
        let albedo = (material.base_color * tint).element_sum() / 3.0;
        reflected.add(albedo / PI * light + albedo * scene.sky.ambient.y);
        emitted.add(luminance(material.emission));
        plain += usize::from(material.emission == Vec3::ZERO);
        count += 1;
    }
    let is_emissive = (plain as f32) < FEW * count as f32;
    let mapped = |mean: LogMean, to: f32| mean.get().map(|mean| to / mean);
    let exposure = if is_emissive { mapped(emitted, EMITTED) } else { mapped(reflected, REFLECTED) };
    exposure.map_or(1.0, |exposure| exposure.clamp(1e-6, 1e6))
}

/// The geometric mean of positive numbers.
#[derive(Clone, Copy, Default)]
struct LogMean {
    sum: f32,
    count: f32,
}

impl LogMean {
    fn add(&mut self, value: f32) {
        if value.is_finite() && value > 1e-9 {
            self.sum += value.ln();
            self.count += 1.0;
        }
    }

    fn get(self) -> Option<f32> {
        (self.count > 0.0).then(|| (self.sum / self.count).exp())
    }
}

fn luminance(color: Vec3) -> f32 {
    color.dot(vec3(0.2126, 0.7152, 0.0722))
}

/// A material with the mean colours of its textures.
fn mean_material(scene: &Scene, material: &Material) -> Material {
    let mean = |texture: Option<u32>| texture.map_or(Vec3::ONE, |texture| scene.textures[texture as usize].mean());
    Material {
        base_color: material.base_color * mean(material.base_color_texture),
        emission: material.emission * mean(material.emission_texture),
        ..*material
    }
}

/// A triangle in world space, its material, and the mean colour of its corners.
type Seen = ([Vec3; 3], u32, Vec3);

/// The triangles in view. All have the same weight, so that dense geometry counts more.
fn in_view(scene: &Scene) -> Vec<Seen> {
    let camera = &scene.camera;
    let forward = (camera.target - camera.eye).normalize_or(Vec3::NEG_Z);
    let placed = scene.objects.iter().filter(|object| object.visible).flat_map(|object| {
        let mesh = &scene.meshes[object.mesh as usize];
        mesh.triangles.iter().enumerate().map(|(index, t)| {
            let tint = mesh.colors.get(index).map_or(Vec3::ONE, |[a, b, c]| (a + b + c).truncate() / 3.0);
            (t.vertices.map(|v| object.transform.transform_point3(v)), t.material, tint)
        })
    });
    let distance = |triangle: &Seen| triangle.0[0].distance(camera.eye);
    let is_in_view = |(triangle, ..): &Seen| {
        triangle.iter().any(|vertex| {
            let to = *vertex - camera.eye;
            to.dot(forward) > 0.7 * to.length()
        })
    };
    let mut triangles: Vec<_> = placed.filter(is_in_view).collect();
    let nearest = triangles.iter().map(distance).fold(f32::INFINITY, f32::min);
    let reach = if nearest < REACH { REACH } else { nearest * FAR_REACH };
    triangles.retain(|triangle| distance(triangle) < reach);
    triangles
}

/// The luminance of the light that arrives at a surface, from a few samples without shadows, in lux.
fn illuminance(sampler: &LightSampler<'_>, point: &ShadingPoint, rng: &mut Rng) -> f32 {
    let samples = 4;
    let mut light = 0.0;
    for _ in 0..samples {
        let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
        let Some(sample) = sampler.sample(point, u) else { continue };
        let incident = sample.incident;
        let cosine = incident.direction.dot(point.normal).max(0.0);
        light += luminance(incident.radiance * (cosine / (sample.pmf * incident.pdf))) / samples as f32;
    }
    light
}

//! The CPU backend. It renders rows in parallel, with the library's sampler and the same estimator
//! as `render.wgsl`.

use super::geometry::Geometry;
use super::image::{Image, ShadowRays};
use super::scene::{Material, Scene};
use super::settings::{LightChoice, Settings};
use super::shading::{Dimension, View, brdf, random, shadow_offset, sky_radiance};
use super::textures::OpacitySeed;
use girandole::glam::{Vec2, Vec3, Vec4};
use girandole::gpu::DEFAULT_USAGE_INTERVAL;
use girandole::light::luminance;
use girandole::{Incident, InstanceKey, LightId, LightSampler, ShadingPoint};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Add;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Shadow rays end at this share of the distance to an area light, just before its surface.
const SHADOW_RAY_SHARE: f32 = 1.0 - 1e-3;

/// How often the lights of each instance were sampled, in a random one of
/// [`DEFAULT_USAGE_INTERVAL`] samples. Ordered by key, so that equal pictures report equal
/// sequences to the light world.
pub type UsageCounters = BTreeMap<InstanceKey, u32>;

/// What is counted while a row is rendered.
#[derive(Default)]
struct Tally {
    rays: ShadowRays,
    usage: UsageCounters,
}

impl Add for Tally {
    type Output = Self;

    fn add(mut self, other: Self) -> Self {
        self.rays = self.rays + other.rays;
        for (instance, count) in other.usage {
            *self.usage.entry(instance).or_default() += count;
        }
        self
    }
}

/// Renders a frame. `progress` receives the finished share, from 0 to 1, on any thread.
pub fn render(
    scene: &Scene,
    geometry: &Geometry,
    sampler: &LightSampler<'_>,
    settings: &Settings,
    seed: u32,
    progress: &(dyn Fn(f64) + Sync),
) -> (Image, ShadowRays, UsageCounters) {
    let (width, height) = (settings.width as usize, settings.height as usize);
    let view = View::new(&scene.camera, settings.width, settings.height);
    let integrator = Integrator { scene, geometry, sampler, choice: settings.light_choice };
    let size = Vec2::new(width as f32, height as f32);
    let mut sums = vec![Vec4::ZERO; width * height];
    let done = AtomicUsize::new(0);
    let rows = sums.par_chunks_mut(width).enumerate().map(|(y, row)| {
        let mut tally = Tally::default();
        for (x, sum) in row.iter_mut().enumerate() {
            let index = (y * width + x) as u32;
            let corner = Vec2::new(x as f32, y as f32);
            for sample in 0..settings.spp {
                let [jitter_x, jitter_y, count_draw, _] = random(index, sample, seed, Dimension::Pixel);
                let direction = view.direction(corner + Vec2::new(jitter_x, jitter_y), size);
                let u = random(index, sample, seed, Dimension::Light);
                let is_counted = count_draw * (DEFAULT_USAGE_INTERVAL as f32) < 1.0;
                let opacity_seed = OpacitySeed::new(index, sample, seed);
                let color = integrator.radiance(view.eye, direction, opacity_seed, u, is_counted, &mut tally);
                *sum += color.extend(luminance(color).powi(2));
            }
        }
        progress((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / height as f64);
        tally
    });
    let Tally { rays, usage } = rows.reduce(Tally::default, |a, b| a + b);
    (Image::from_sums(settings.width, settings.height, settings.spp, sums.into_iter()), rays, usage)
}

/// Computes the radiance of camera rays.
struct Integrator<'a> {
    scene: &'a Scene,
    geometry: &'a Geometry,
    sampler: &'a LightSampler<'a>,
    choice: LightChoice,
}

/// A point that a camera ray met.
struct Surface<'a> {
    material: &'a Material,
    shading_point: ShadingPoint,
    /// The unit direction to the camera.
    view: Vec3,
}

impl Integrator<'_> {
    /// One sample of the radiance along a camera ray.
    fn radiance(
        &self,
        eye: Vec3,
        direction: Vec3,
        opacity_seed: OpacitySeed,
        u: [f32; 4],
        is_counted: bool,
        tally: &mut Tally,
    ) -> Vec3 {
        let Some(hit) = self.geometry.nearest_at_random(eye, direction, opacity_seed) else {
            return sky_radiance(&self.scene.sky, direction);
        };
        let object = &self.geometry.objects[hit.object as usize];
        let material = &self.geometry.material(self.scene, &hit);
        let front = self.geometry.normal(&hit);
        let view = -direction;
        let is_front = front.dot(view) >= 0.0;
        let normal = if is_front { front } else { -front };

        let mut sum = self.scene.sky.ambient * material.base_color;
        if is_front || material.two_sided_emission {
            sum += material.emission * object.emission_scale;
        }

        let surface = eye + direction * hit.distance;
        let position = surface + normal * shadow_offset(surface, hit.distance);
        let surface = Surface { material, shading_point: ShadingPoint::surface(position, normal), view };
        sum + match self.choice {
            LightChoice::Tree => match self.sampler.sample(&surface.shading_point, u) {
                Some(sample) => {
                    if let LightId::Local { instance, .. } = sample.light
                        && is_counted
                    {
                        *tally.usage.entry(instance).or_default() += 1;
                    }
                    self.reflected(&surface, &sample.incident, &mut tally.rays) / sample.pmf
                }
                None => Vec3::ZERO,
            },
            LightChoice::Exhaustive => self
                .sampler
                .all_lights()
                .filter_map(|light| self.sampler.sample_light(&surface.shading_point, light, [u[2], u[3]]))
                .map(|incident| self.reflected(&surface, &incident, &mut tally.rays))
                .sum(),
        }
    }

    /// The radiance that one sample of one light adds, not yet divided by the pmf of the light.
    fn reflected(&self, surface: &Surface, incident: &Incident, rays: &mut ShadowRays) -> Vec3 {
        let ShadingPoint { position, normal, .. } = surface.shading_point;
        let cosine = normal.dot(incident.direction);
        if cosine <= 0.0 {
            return Vec3::ZERO;
        }
        let contribution = brdf(surface.material, normal, surface.view, incident.direction)
            * incident.radiance
            * (cosine / incident.pdf);
        if contribution.max_element() <= 0.0 {
            return Vec3::ZERO;
        }
        let limit = if incident.is_delta {
            incident.dist - self.scene.lamp_clearance
        } else {
            incident.dist * SHADOW_RAY_SHARE
        };
        if !self.geometry.occluders.may_block(position, incident.direction, limit) {
            rays.skipped += 1;
            return contribution;
        }
        rays.traced += 1;
        contribution * self.geometry.transmittance(position, incident.direction, limit)
    }
}

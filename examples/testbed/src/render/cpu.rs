//! The CPU backend. It renders rows in parallel, with the library's sampler and the same estimator
//! as `render.wgsl`.

use super::geometry::Geometry;
use super::image::{Image, ShadowRays, first_half};
use super::rays::Hit;
use super::scene::{Material, Scene};
use super::sequence::{PixelSequence, SampleNumbers};
use super::settings::Settings;
use super::shading::{View, brdf, gloss, shadow_offset, sky_radiance, through_haze};
use super::textures::OpacitySeed;
use girandole::glam::{Vec2, Vec3, Vec4};
use girandole::light::luminance;
use girandole::{Incident, LightId, LightSampler, ShadingPoint};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Shadow rays end at this share of the distance to an area light, just before its surface.
const SHADOW_RAY_SHARE: f32 = 1.0 - 1e-3;

/// Renders a frame. `progress` receives the finished share, from 0 to 1, on any thread.
pub fn render(
    integrator: &Integrator<'_>,
    settings: &Settings,
    seed: u32,
    progress: &(dyn Fn(f64) + Sync),
) -> (Image, ShadowRays) {
    let (width, height) = (settings.width as usize, settings.height as usize);
    let view = View::new(&integrator.scene.camera, settings.width, settings.height);
    let size = Vec2::new(width as f32, height as f32);
    let mut sums = vec![Vec4::ZERO; width * height];
    let first_half = first_half(settings.spp);
    let done = AtomicUsize::new(0);
    let rows = sums.par_chunks_mut(width).enumerate().map(|(y, row)| {
        let mut rays = ShadowRays::default();
        for (x, sum) in row.iter_mut().enumerate() {
            let pixel = (y * width + x) as u32;
            let sequence = PixelSequence::new(x as u32, y as u32, settings.spp, seed);
            let corner = Vec2::new(x as f32, y as f32);
            for sample in 0..settings.spp {
                let numbers = sequence.sample(sample);
                let direction = view.direction(corner + Vec2::from(numbers.jitter), size);
                let opacity_seed = OpacitySeed::new(pixel, sample, seed);
                let color = integrator.radiance(view.eye, direction, opacity_seed, &numbers, &mut rays);
                *sum += color.extend(if sample < first_half { luminance(color) } else { 0.0 });
            }
        }
        progress((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / height as f64);
        rays
    });
    let rays = rows.reduce(ShadowRays::default, |a, b| a + b);
    (Image::from_sums(settings.width, settings.height, settings.spp, sums.into_iter()), rays)
}

/// Marks the surfaces that the first sample of each pixel shows in the table of the integrator's sampler.
pub fn mark(integrator: &Integrator<'_>, settings: &Settings, seed: u32) {
    let view = View::new(&integrator.scene.camera, settings.width, settings.height);
    let size = Vec2::new(settings.width as f32, settings.height as f32);
    (0..settings.height).into_par_iter().for_each(|y| {
        for x in 0..settings.width {
            let numbers = PixelSequence::new(x, y, settings.spp, seed).sample(0);
            let direction = view.direction(Vec2::new(x as f32, y as f32) + Vec2::from(numbers.jitter), size);
            let opacity_seed = OpacitySeed::new(y * settings.width + x, 0, seed);
            let met = integrator.met(view.eye, direction, opacity_seed);
            if let Some(met) = met.filter(|met| !met.material.is_unlit) {
                integrator.sampler.mark(&integrator.shading_point(&met));
            }
        }
    });
}

/// Computes the radiance of camera rays.
pub struct Integrator<'a> {
    /// What the rays meet.
    pub scene: &'a Scene,
    /// The same, for rays.
    pub geometry: &'a Geometry,
    /// Knows all lights and the light trees.
    pub sampler: LightSampler<'a>,
    /// Candidates of which each sample keeps one; `None` to sum up all lights in each sample.
    pub candidates: Option<u32>,
}

/// The radiance of a surface that a camera ray met, by its origin.
pub struct Seen {
    /// Of the surface itself.
    pub emitted: Vec3,
    /// Reflected from the lights: one sample of it.
    pub reflected: Vec3,
    /// Reflected from the sky.
    pub ambient: Vec3,
    /// From the camera, metres.
    pub distance: f32,
    /// What it shows follows the exposure.
    pub is_unlit: bool,
}

/// What a camera ray met.
struct Met {
    hit: Hit,
    material: Material,
    /// Where on the facet.
    place: Vec3,
    /// The unit normal of the facet.
    front: Vec3,
    /// The unit direction to the camera.
    view: Vec3,
}

impl Met {
    fn is_front(&self) -> bool {
        self.front.dot(self.view) >= 0.0
    }

    /// The radiance that one point of a light adds if nothing blocks it, not yet divided by a
    /// density.
    fn reflected(&self, at: &ShadingPoint, incident: &Incident) -> Vec3 {
        let cosine = at.normal.dot(incident.direction);
        if cosine <= 0.0 {
            return Vec3::ZERO;
        }
        brdf(&self.material, at.normal, self.view, incident.direction) * incident.radiance * cosine
    }
}

impl Integrator<'_> {
    /// One sample of the radiance along a camera ray.
    fn radiance(
        &self,
        eye: Vec3,
        direction: Vec3,
        opacity_seed: OpacitySeed,
        numbers: &SampleNumbers,
        rays: &mut ShadowRays,
    ) -> Vec3 {
        let sky = &self.scene.sky;
        let Some(seen) = self.seen(eye, direction, opacity_seed, numbers, rays) else {
            return sky_radiance(sky, direction);
        };
        through_haze(sky, seen.ambient + seen.emitted + seen.reflected, seen.distance)
    }

    /// The surface along a camera ray; `None` for the sky.
    pub fn seen(
        &self,
        eye: Vec3,
        direction: Vec3,
        opacity_seed: OpacitySeed,
        numbers: &SampleNumbers,
        rays: &mut ShadowRays,
    ) -> Option<Seen> {
        let met = self.met(eye, direction, opacity_seed)?;
        let Met { hit, material, .. } = &met;
        let object = &self.geometry.objects[hit.object as usize];
        let shines = met.is_front() || material.two_sided_emission;
        let emitted = if shines { material.emission * object.emission_scale } else { Vec3::ZERO };
        let ambient = self.scene.sky.ambient * material.base_color;
        let reflected = match self.candidates {
            _ if material.is_unlit => Vec3::ZERO,
            Some(candidates) => self.by_trees(&met, candidates, numbers, rays),
            None => self.by_all(&met, numbers, rays),
        };
        Some(Seen { emitted, reflected, ambient, distance: hit.distance, is_unlit: material.is_unlit })
    }

    /// What is met along a camera ray; `None` for the sky.
    fn met(&self, eye: Vec3, direction: Vec3, opacity_seed: OpacitySeed) -> Option<Met> {
        let hit = self.geometry.nearest_at_random(eye, direction, opacity_seed)?;
        let material = self.geometry.material(self.scene, &hit);
        let front = self.geometry.normal(&hit);
        Some(Met { hit, material, place: eye + direction * hit.distance, front, view: -direction })
    }

    fn shading_point(&self, met: &Met) -> ShadingPoint {
        let is_front = met.is_front();
        let facing = |normal: Vec3| if is_front { normal } else { -normal };
        let offset = facing(met.front) * shadow_offset(met.place, met.hit.distance);
        let position = met.place + self.geometry.to_smooth_surface(&met.hit, is_front) + offset;
        let normal = facing(self.geometry.shading_normal(&met.hit));
        ShadingPoint::surface(position, normal).with_gloss(gloss(&met.material, met.view))
    }

    /// The light of one sample: of several candidates, one is kept in proportion to what it
    /// reflects without shadows, and gets a shadow ray.
    fn by_trees(&self, met: &Met, candidates: u32, numbers: &SampleNumbers, rays: &mut ShadowRays) -> Vec3 {
        let [a, b, x, y] = numbers.light;
        let at = self.shading_point(met);
        let own = self.sampler.resample(&at, [a, b, x, y, numbers.choice], candidates);
        let Some(light) = self.sampler.reservoir_sample(&at, &own) else { return Vec3::ZERO };
        // As if its light was the only one.
        let target = luminance(met.reflected(&at, &light.incident)) / light.incident.pdf;
        if target <= 0.0 {
            return Vec3::ZERO;
        }
        let shadowed = target * self.transmittance(&at, &light.incident, rays);
        if shadowed <= 0.0 {
            return Vec3::ZERO;
        }
        // The share that passes what is in the way.
        let share = shadowed / target;
        met.reflected(&at, &light.incident) * (share / (light.pmf * light.incident.pdf))
    }

    /// The light of all lights, with one shadow ray to a point on each.
    fn by_all(&self, met: &Met, numbers: &SampleNumbers, rays: &mut ShadowRays) -> Vec3 {
        let [.., x, y] = numbers.light;
        let at = self.shading_point(met);
        let one = |light: LightId| {
            let incident = self.sampler.sample_light(&at, light, [x, y])?;
            let contribution = met.reflected(&at, &incident) / incident.pdf;
            let reflects = contribution.max_element() > 0.0;
            reflects.then(|| contribution * self.transmittance(&at, &incident, rays))
        };
        self.sampler.all_lights().filter_map(one).sum()
    }

    /// The share of the light from a point on a light that reaches a surface.
    fn transmittance(&self, at: &ShadingPoint, incident: &Incident, rays: &mut ShadowRays) -> f32 {
        let limit = if incident.is_delta {
            incident.dist - self.scene.lamp_clearance
        } else {
            incident.dist * SHADOW_RAY_SHARE
        };
        if !self.geometry.occluders.may_block(at.position, incident.direction, limit) {
            rays.skipped += 1;
            return 1.0;
        }
        rays.traced += 1;
        self.geometry.transmittance(at.position, incident.direction, limit)
    }
}

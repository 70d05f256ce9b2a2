//! The CPU backend. It renders rows in parallel, with the library's sampler and the same estimator
//! as `render.wgsl`.

use super::baseline::Baseline;
use super::choice::Choice;
use super::geometry::Geometry;
use super::history::{Before, History, Kept, MERGES, Surface};
use super::image::{Image, ShadowRays, first_half};
use super::rays::Hit;
use super::scene::{Material, Scene};
use super::sequence::{PixelSequence, SampleNumbers};
use super::settings::Settings;
use super::shading::{View, brdf, gloss, shadow_offset, sky_radiance, through_haze};
use super::textures::OpacitySeed;
use girandole::glam::{Vec2, Vec3, Vec4};
use girandole::light::luminance;
use girandole::{Incident, LightId, LightSample, LightSampler, Reservoir, ShadingPoint};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Shadow rays end at this share of the distance to an area light, just before its surface.
const SHADOW_RAY_SHARE: f32 = 1.0 - 1e-3;

/// The lights of a frame and how each sample chooses among them.
#[derive(Clone, Copy)]
pub struct Lights<'a> {
    /// Knows all lights and the light trees.
    pub sampler: LightSampler<'a>,
    /// How lights are chosen.
    pub choice: Choice<'a>,
}

/// A picture, and what its pixels keep for the next one.
pub struct Rendered {
    pub image: Image,
    pub rays: ShadowRays,
    /// For each pixel, if [`Settings::reused`].
    pub kept: Vec<Option<Kept>>,
}

/// Renders a frame, whose pixels take over lights of the frame before. Lights are chosen as `lights` says;
/// [`Settings::light_choice`] is not read. `progress` receives the finished share, from 0 to 1, on any thread.
pub fn render(
    (scene, geometry): (&Scene, &Geometry),
    lights: Lights<'_>,
    history: Option<&History>,
    settings: &Settings,
    seed: u32,
    progress: &(dyn Fn(f64) + Sync),
) -> Rendered {
    let (width, height) = (settings.width as usize, settings.height as usize);
    let view = View::new(&scene.camera, settings.width, settings.height);
    let integrator = Integrator { scene, geometry, lights, candidates: settings.candidates };
    let size = Vec2::new(width as f32, height as f32);
    let before = history.and_then(|history| history.before(settings.width, settings.height));
    let mut sums = vec![Vec4::ZERO; width * height];
    let first_half = first_half(settings.spp);
    let done = AtomicUsize::new(0);
    let rows = sums.par_chunks_mut(width).enumerate().map(|(y, row)| {
        let (mut rays, mut all_kept) = (ShadowRays::default(), Vec::new());
        for (x, sum) in row.iter_mut().enumerate() {
            let pixel = (y * width + x) as u32;
            let reuse = before.map(|before| Reuse { before, draws: settings.reused() as f32, pixel, seed });
            let sequence = PixelSequence::new(x as u32, y as u32, settings.spp, seed);
            let corner = Vec2::new(x as f32, y as f32);
            for sample in 0..settings.spp {
                let numbers = sequence.sample(sample);
                let direction = view.direction(corner + Vec2::from(numbers.jitter), size);
                let opacity_seed = OpacitySeed::new(pixel, sample, seed);
                let (color, kept) =
                    integrator.radiance((view.eye, direction), opacity_seed, &numbers, reuse, &mut rays);
                *sum += color.extend(if sample < first_half { luminance(color) } else { 0.0 });
                if settings.reused() > 0 {
                    all_kept.push(kept);
                }
            }
        }
        progress((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / height as f64);
        (rays, all_kept)
    });
    let (rays, kept): (Vec<ShadowRays>, Vec<Vec<Option<Kept>>>) = rows.unzip();
    let rays = rays.into_iter().fold(ShadowRays::default(), |a, b| a + b);
    let kept = kept.into_iter().flatten().collect();
    Rendered { image: Image::from_sums(settings.width, settings.height, settings.spp, sums.into_iter()), rays, kept }
}

/// What a pixel may take over of the last frame.
#[derive(Clone, Copy)]
struct Reuse<'a> {
    before: Before<'a>,
    /// The draws that a kept light stands for, at most.
    draws: f32,
    pixel: u32,
    seed: u32,
}

/// Marks the surfaces that the first sample of each pixel shows in the table of the sampler of `lights`.
pub fn mark(scene: &Scene, geometry: &Geometry, lights: Lights<'_>, settings: &Settings, seed: u32) {
    let view = View::new(&scene.camera, settings.width, settings.height);
    let integrator = Integrator { scene, geometry, lights, candidates: settings.candidates };
    let size = Vec2::new(settings.width as f32, settings.height as f32);
    (0..settings.height).into_par_iter().for_each(|y| {
        for x in 0..settings.width {
            let numbers = PixelSequence::new(x, y, settings.spp, seed).sample(0);
            let direction = view.direction(Vec2::new(x as f32, y as f32) + Vec2::from(numbers.jitter), size);
            let opacity_seed = OpacitySeed::new(y * settings.width + x, 0, seed);
            let met = integrator.met(view.eye, direction, opacity_seed);
            if let Some(met) = met.filter(|met| !met.material.is_unlit) {
                lights.sampler.mark(&integrator.shading_point(&met));
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
    /// What lights it.
    pub lights: Lights<'a>,
    /// Candidates of which each sample keeps one.
    pub candidates: u32,
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
}

impl Surface {
    /// The radiance that one point of a light adds if nothing blocks it, not yet divided by a
    /// density.
    fn reflected(&self, incident: &Incident) -> Vec3 {
        let normal = self.shading_point.normal;
        let cosine = normal.dot(incident.direction);
        if cosine <= 0.0 {
            return Vec3::ZERO;
        }
        brdf(&self.material, normal, self.view, incident.direction) * incident.radiance * cosine
    }

    /// The luminance of the light of a sample without shadows, as if its light was the only one.
    fn target(&self, light: &LightSample) -> f32 {
        luminance(self.reflected(&light.incident)) / light.incident.pdf
    }
}

impl Integrator<'_> {
    /// One sample of the radiance along a camera ray.
    fn radiance(
        &self,
        (eye, direction): (Vec3, Vec3),
        opacity_seed: OpacitySeed,
        numbers: &SampleNumbers,
        reuse: Option<Reuse<'_>>,
        rays: &mut ShadowRays,
    ) -> (Vec3, Option<Kept>) {
        let sky = &self.scene.sky;
        let Some((seen, kept)) = self.seen_by(eye, direction, opacity_seed, numbers, reuse, rays) else {
            return (sky_radiance(sky, direction), None);
        };
        (through_haze(sky, seen.ambient + seen.emitted + seen.reflected, seen.distance), kept)
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
        self.seen_by(eye, direction, opacity_seed, numbers, None, rays).map(|(seen, _)| seen)
    }

    /// The same, and what the pixel keeps.
    fn seen_by(
        &self,
        eye: Vec3,
        direction: Vec3,
        opacity_seed: OpacitySeed,
        numbers: &SampleNumbers,
        reuse: Option<Reuse<'_>>,
        rays: &mut ShadowRays,
    ) -> Option<(Seen, Option<Kept>)> {
        let met = self.met(eye, direction, opacity_seed)?;
        let Met { hit, material, view, .. } = &met;
        let object = &self.geometry.objects[hit.object as usize];
        let shines = met.is_front() || material.two_sided_emission;
        let emitted = if shines { material.emission * object.emission_scale } else { Vec3::ZERO };
        let ambient = self.scene.sky.ambient * material.base_color;
        if material.is_unlit {
            let seen = Seen { emitted, reflected: Vec3::ZERO, ambient, distance: hit.distance, is_unlit: true };
            return Some((seen, None));
        }
        let surface = Surface { material: *material, shading_point: self.shading_point(&met), view: *view };
        let mut kept = None;
        let reflected = match self.lights.choice {
            Choice::Trees => {
                let (light, reservoir) = self.by_trees(&surface, numbers, reuse, rays);
                kept = Some(Kept { surface, reservoir });
                light
            }
            Choice::Baseline(baseline) => self.by_baseline(&surface, baseline, numbers, rays),
            Choice::All => self.by_all(&surface, numbers, rays),
        };
        Some((Seen { emitted, reflected, ambient, distance: hit.distance, is_unlit: false }, kept))
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

    /// The light of one sample, and its reservoir: of several candidates, one is kept in proportion to what it
    /// reflects without shadows, and gets a shadow ray. Then those of the last frame are merged.
    fn by_trees(
        &self,
        surface: &Surface,
        numbers: &SampleNumbers,
        reuse: Option<Reuse<'_>>,
        rays: &mut ShadowRays,
    ) -> (Vec3, Reservoir) {
        let [a, b, x, y] = numbers.light;
        let (sampler, at) = (self.lights.sampler, &surface.shading_point);
        let mut own = sampler.resample(at, [a, b, x, y, numbers.choice], self.candidates);
        let mut light = sampler.reservoir_sample(at, &own);
        own.reflected = self.target(self.geometry, surface, light.as_ref(), rays);
        if let Some(reuse) = reuse {
            own = (0..MERGES).fold(own, |own, n| self.merged(surface, own, reuse, n, rays));
            light = sampler.reservoir_sample(at, &own);
        }
        let Some(light) = light.filter(|_| own.reflected > 0.0) else { return (Vec3::ZERO, own) };
        // The share that passes what is in the way.
        let share = own.reflected / surface.target(&light);
        (surface.reflected(&light.incident) * (share / (light.pmf * light.incident.pdf)), own)
    }

    /// [`Surface::target`] with shadows.
    fn target(
        &self,
        geometry: &Geometry,
        surface: &Surface,
        light: Option<&LightSample>,
        rays: &mut ShadowRays,
    ) -> f32 {
        let target = light.map_or(0.0, |light| surface.target(light));
        match light {
            Some(light) if target > 0.0 => target * self.transmittance(geometry, surface, &light.incident, rays),
            _ => 0.0,
        }
    }

    /// Merges what a pixel of the last frame has kept.
    fn merged(&self, surface: &Surface, own: Reservoir, reuse: Reuse<'_>, n: u32, rays: &mut ShadowRays) -> Reservoir {
        let Reuse { before, draws, pixel, seed } = reuse;
        let Some((kept, choice)) = before.merged(pixel, surface, n, seed) else { return own };
        let other = Reservoir { count: kept.reservoir.count.min(draws), ..kept.reservoir };
        let there = before.lights().reservoir_sample(&kept.surface.shading_point, &own);
        let own_there = self.target(before.geometry, &kept.surface, there.as_ref(), rays);
        let here = self.lights.sampler.reservoir_sample(&surface.shading_point, &other);
        let other_here = self.target(self.geometry, surface, here.as_ref(), rays);
        own.merge(own_there, &other, other_here, choice)
    }

    /// The light of one sample, from a sampler to compare with.
    fn by_baseline(
        &self,
        surface: &Surface,
        baseline: &Baseline,
        numbers: &SampleNumbers,
        rays: &mut ShadowRays,
    ) -> Vec3 {
        let [a, b, x, y] = numbers.light;
        let mut sample = || {
            let pick = baseline.choose(&surface.shading_point, [a, b])?;
            let incident = self.lights.sampler.sample_light(&surface.shading_point, pick.light, [x, y])?;
            let contribution = surface.reflected(&incident) / (incident.pdf * pick.pmf);
            let reflects = contribution.max_element() > 0.0;
            reflects.then(|| contribution * self.transmittance(self.geometry, surface, &incident, rays))
        };
        sample().unwrap_or_default()
    }

    /// The light of all lights, with one shadow ray to a point on each.
    fn by_all(&self, surface: &Surface, numbers: &SampleNumbers, rays: &mut ShadowRays) -> Vec3 {
        let [.., x, y] = numbers.light;
        let one = |light: LightId| {
            let incident = self.lights.sampler.sample_light(&surface.shading_point, light, [x, y])?;
            let contribution = surface.reflected(&incident) / incident.pdf;
            let reflects = contribution.max_element() > 0.0;
            reflects.then(|| contribution * self.transmittance(self.geometry, surface, &incident, rays))
        };
        self.lights.sampler.all_lights().filter_map(one).sum()
    }

    /// The share of the light from a point on a light that reaches a surface.
    fn transmittance(&self, geometry: &Geometry, surface: &Surface, incident: &Incident, rays: &mut ShadowRays) -> f32 {
        let position = surface.shading_point.position;
        let limit = if incident.is_delta {
            incident.dist - self.scene.lamp_clearance
        } else {
            incident.dist * SHADOW_RAY_SHARE
        };
        if !geometry.occluders.may_block(position, incident.direction, limit) {
            rays.skipped += 1;
            return 1.0;
        }
        rays.traced += 1;
        geometry.transmittance(position, incident.direction, limit)
    }
}

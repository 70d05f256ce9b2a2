//! The light of a sample by one drawn light, and that of a pixel by all lights.

use super::draw::{Draw, Found, Sample, reflected};
use super::shadows::Shadows;
use super::view::{SUBPIXELS, Surface, View};
use crate::common::lattice::{Dimension, random};
use crate::render::geometry::Geometry;
use crate::scene::{Material, Scene};
use girandole::glam::Vec3;
use girandole::light::luminance;
use girandole::{Incident, LightId, LightSampler};

/// Five random numbers in [0, 1) for a pixel, a sample and a seed.
pub type Numbers = fn(u32, u32, u32) -> [f32; 5];

/// What all ways to draw share: the surfaces in view, their materials, and what casts shadows.
#[derive(Clone, Copy)]
pub struct Renderer<'a> {
    pub scene: &'a Scene,
    pub geometry: &'a Geometry,
    pub view: &'a View,
    /// The random numbers of samples.
    pub numbers: Numbers,
}

impl Renderer<'_> {
    /// The radiance of one pixel by all lights, with one shadow ray to each light in each of
    /// `samples` samples.
    pub fn pixel_by_all(
        &self,
        lights: &LightSampler<'_>,
        ids: &[LightId],
        index: usize,
        (samples, seed): (u32, u32),
    ) -> Vec3 {
        let pixel = &self.view.pixels[index];
        let [_, first, ..] = random(index as u32, 0, seed, Dimension::Pixel);
        let first = (first * SUBPIXELS as f32) as usize;
        let sum: Vec3 = (0..samples)
            .filter_map(|sample| {
                let surface = pixel.surfaces[(sample as usize + first) % SUBPIXELS].as_ref()?;
                let [.., x, y] = random(index as u32, sample, seed, Dimension::Light);
                let one = |light: &LightId| {
                    let incident = lights.sample_light(&surface.shading_point, *light, [x, y])?;
                    let light = self.reflected(surface, &incident) / incident.pdf;
                    (light.max_element() > 0.0 && !self.is_shadowed(surface, &incident)).then_some(light)
                };
                Some(ids.iter().filter_map(one).sum::<Vec3>())
            })
            .sum();
        pixel.background + sum / samples as f32
    }

    /// The light of the sample of a pixel in a frame, and what it has found. Samples visit the
    /// subpixels in turn. `seed` and `frame` as in [`Sample`].
    pub(super) fn sample(&self, draw: &dyn Draw, index: usize, (seed, frame): (u32, u32)) -> (Vec3, Found) {
        const NOTHING: (Vec3, Found) = (Vec3::ZERO, Found { light: 0, luminance: 0.0 });
        let pixel = index as u32;
        let [_, first, ..] = random(pixel, 0, seed, Dimension::Pixel);
        let first = (first * SUBPIXELS as f32) as usize;
        let surface = self.view.pixels[index].surfaces[(frame as usize + first) % SUBPIXELS].as_ref();
        let Some(surface) = surface else { return NOTHING };
        let sample = Sample { pixel, frame, u: (self.numbers)(pixel, frame, seed) };
        let Some(drawn) = draw.draw(surface, self.material(surface), &sample) else { return NOTHING };
        let light = self.reflected(surface, &drawn.incident) * drawn.weight;
        if light.max_element() <= 0.0 {
            return NOTHING;
        }
        let is_visible = !self.is_shadowed(surface, &drawn.incident);
        draw.learn(surface, &sample, &drawn, is_visible);
        if !is_visible {
            return NOTHING;
        }
        (light, Found { light: drawn.light, luminance: luminance(light) })
    }

    /// The material of a surface.
    pub fn material(&self, surface: &Surface) -> &Material {
        &self.scene.materials[surface.material as usize]
    }

    /// The integrand of direct light, as [`reflected`].
    pub(super) fn reflected(&self, surface: &Surface, incident: &Incident) -> Vec3 {
        reflected(surface, self.material(surface), incident)
    }

    /// Whether something opaque lies between a surface and a point on a light.
    pub fn is_shadowed(&self, surface: &Surface, incident: &Incident) -> bool {
        Shadows::new(self.scene, self.geometry).is_shadowed(&surface.shading_point, incident)
    }
}

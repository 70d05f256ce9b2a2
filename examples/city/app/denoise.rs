//! Takes the noise out of the picture for the eye. Only the PNG sees it: the EXR holds what was sampled.
//!
//! Edge-avoiding a-trous wavelets [Dammertz et al. 2010] guided by surfaces and by the noise of each pixel, as SVGF
//! [Schied et al. 2017] has it. Differs: the noise is measured from the samples of the frame itself, so that the filter
//! fades as samples grow, and nothing is taken from earlier frames.

use super::render::geometry::Geometry;
use super::render::image::Image;
use super::render::shading::View;
use super::scene::Scene;
use girandole::glam::{IVec2, Vec2, Vec3};
use girandole::light::luminance;
use rayon::prelude::*;

/// Wavelet levels: the last reaches 2^5 pixels.
const LEVELS: u32 = 5;
/// The B3 spline's weights.
const KERNEL: [f32; 3] = [0.375, 0.25, 0.0625];
/// Standard errors by which neighbours may differ and still be thought the same.
const TOLERANCE: f32 = 3.0;
/// A pixel this many of its neighbourhood's deviations above its mean is a speck.
const SPECK: f32 = 2.5;
/// Added to the base colour that light is divided by: what a dielectric reflects.
const SHEEN: f32 = 0.04;

/// What a pixel shows: surfaces as seen through its middle, colour as the mean of what is seen through its corners too,
/// so that edges between colours stay smooth.
#[derive(Clone, Copy)]
struct Guide {
    position: Vec3,
    normal: Vec3,
    /// What light is divided by before the filter and multiplied by after it.
    albedo: Vec3,
    /// Width of a pixel there.
    footprint: f32,
    /// Sky and lamps have no noise; where some of a pixel is one of them, it is left alone.
    filtered: bool,
}

/// Light, and the square of the standard error of its luminance.
#[derive(Clone, Copy)]
struct Sample {
    light: Vec3,
    variance: f32,
}

struct Filter {
    size: IVec2,
    guides: Vec<Guide>,
}

/// A picture of the same view with less noise.
pub fn denoise(image: &Image, scene: &Scene, geometry: &Geometry) -> Image {
    let size = IVec2::new(image.width as i32, image.height as i32);
    let filter = Filter { size, guides: guides(image, scene, geometry) };
    let mut samples: Vec<Sample> = image
        .pixels
        .iter()
        .zip(&image.variance)
        .zip(&filter.guides)
        .map(|((&pixel, &variance), guide)| {
            let scale = luminance(guide.albedo);
            Sample { light: pixel / guide.albedo, variance: variance / (scale * scale) }
        })
        .collect();
    samples = filter.map(&samples, |filter, samples, place| filter.despeckle(samples, place));
    for level in 0..LEVELS {
        // Few samples know little of their own noise; their neighbours' noise is like it.
        let smooth: Vec<f32> = filter.map_to(&samples, |filter, samples, place| filter.smooth_variance(samples, place));
        samples = filter.map(&samples, |filter, samples, place| filter.spread(samples, &smooth, place, 1 << level));
    }
    let pixels = samples
        .iter()
        .zip(&filter.guides)
        .zip(&image.pixels)
        .map(|((sample, guide), &pixel)| if guide.filtered { sample.light * guide.albedo } else { pixel })
        .collect();
    Image { pixels, ..image.clone() }
}

fn guides(image: &Image, scene: &Scene, geometry: &Geometry) -> Vec<Guide> {
    let size = Vec2::new(image.width as f32, image.height as f32);
    let view = View::new(&scene.camera, image.width, image.height);
    let spread = view.up.length() * 2.0 / size.y;
    let seen = |place: Vec2| {
        let hit = geometry.nearest(view.eye, view.direction(place, size))?;
        Some((hit, &scene.materials[geometry.triangles[hit.triangle as usize].material as usize]))
    };
    let guide = |index: usize| {
        let middle = Vec2::new((index % image.width as usize) as f32, (index / image.width as usize) as f32) + 0.5;
        let nothing =
            Guide { position: Vec3::ZERO, normal: Vec3::Y, albedo: Vec3::ONE, footprint: 1.0, filtered: false };
        let Some((hit, material)) = seen(middle) else { return nothing };
        let mut albedo = material.base_color;
        for corner in [Vec2::new(-0.3, -0.3), Vec2::new(0.3, -0.3), Vec2::new(-0.3, 0.3), Vec2::new(0.3, 0.3)] {
            match seen(middle + corner) {
                Some((_, other)) if other.emission == Vec3::ZERO => albedo += other.base_color,
                _ => return nothing,
            }
        }
        let direction = view.direction(middle, size);
        Guide {
            position: view.eye + direction * hit.distance,
            normal: geometry.normal(&hit),
            albedo: albedo / 5.0 + SHEEN,
            footprint: hit.distance * spread,
            filtered: material.emission == Vec3::ZERO,
        }
    };
    (0..image.pixels.len()).into_par_iter().map(guide).collect()
}

impl Filter {
    fn map(&self, from: &[Sample], f: impl Fn(&Self, &[Sample], IVec2) -> Sample + Sync) -> Vec<Sample> {
        self.map_to(from, f)
    }

    fn map_to<T: Send>(&self, from: &[Sample], f: impl Fn(&Self, &[Sample], IVec2) -> T + Sync) -> Vec<T> {
        let width = self.size.x as usize;
        (0..from.len())
            .into_par_iter()
            .map(|i| f(self, from, IVec2::new((i % width) as i32, (i / width) as i32)))
            .collect()
    }

    fn index(&self, place: IVec2) -> usize {
        (place.y * self.size.x + place.x) as usize
    }

    /// Pixels around a place of the same kind of surface, with how alike they are.
    fn neighbours(&self, place: IVec2, radius: i32, step: i32) -> impl Iterator<Item = (usize, IVec2, f32)> {
        let own = self.guides[self.index(place)];
        let offsets = (-radius..=radius).flat_map(move |y| (-radius..=radius).map(move |x| IVec2::new(x, y)));
        offsets.filter_map(move |offset| {
            let at = place + offset * step;
            if at.cmplt(IVec2::ZERO).any() || at.cmpge(self.size).any() {
                return None;
            }
            let index = self.index(at);
            let other = &self.guides[index];
            if !own.filtered || !other.filtered {
                return None;
            }
            let off_plane = own.normal.dot(other.position - own.position).abs() / (own.footprint * step as f32);
            let facing = own.normal.dot(other.normal).max(0.0).powi(32);
            let alike = facing * (-off_plane).exp();
            (alike > 1e-3).then_some((index, offset, alike))
        })
    }

    /// Lowers a pixel that stands far out of its surroundings.
    fn despeckle(&self, samples: &[Sample], place: IVec2) -> Sample {
        let own = samples[self.index(place)];
        let (mut weight, mut sum, mut square_sum) = (0.0, 0.0, 0.0);
        for (index, offset, alike) in self.neighbours(place, 3, 1) {
            if offset != IVec2::ZERO {
                let l = luminance(samples[index].light);
                weight += alike;
                sum += alike * l;
                square_sum += alike * l * l;
            }
        }
        if weight < 1.0 {
            return own;
        }
        let mean = sum / weight;
        let limit = mean + SPECK * (square_sum / weight - mean * mean).max(0.0).sqrt();
        let l = luminance(own.light);
        if l <= limit {
            return own;
        }
        let scale = limit / l;
        Sample { light: own.light * scale, variance: own.variance * scale * scale }
    }

    fn smooth_variance(&self, samples: &[Sample], place: IVec2) -> f32 {
        let (mut weight, mut sum) = (1e-6, 1e-6 * samples[self.index(place)].variance);
        for (index, _, alike) in self.neighbours(place, 2, 1) {
            weight += alike;
            sum += alike * samples[index].variance;
        }
        sum / weight
    }

    /// One wavelet level.
    fn spread(&self, samples: &[Sample], variance: &[f32], place: IVec2, step: i32) -> Sample {
        let center = self.index(place);
        let own = luminance(samples[center].light);
        let scale = 1.0 / (TOLERANCE * variance[center].max(0.0).sqrt() + 1e-6);
        let (mut weight_sum, mut light, mut noise) = (0.0, Vec3::ZERO, 0.0);
        for (index, offset, alike) in self.neighbours(place, 2, step) {
            let kernel = KERNEL[offset.x.unsigned_abs() as usize] * KERNEL[offset.y.unsigned_abs() as usize];
            let differs = (luminance(samples[index].light) - own).abs() * scale;
            let weight = kernel * alike * (-differs).exp();
            weight_sum += weight;
            light += samples[index].light * weight;
            noise += samples[index].variance * weight * weight;
        }
        if weight_sum <= 0.0 {
            return samples[center];
        }
        Sample { light: light / weight_sum, variance: noise / (weight_sum * weight_sum) }
    }
}

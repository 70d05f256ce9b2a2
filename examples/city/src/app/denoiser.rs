//! Filters the noise of pictures for a screen: PNG files, films and the window.
//!
//! Based on edge-avoiding a-trous wavelets [Dammertz et al. 2010], guided by surfaces and by the
//! noise of each pixel as in SVGF [Schied et al. 2017]. Differs: the caller passes an estimate of
//! the noise with the picture, so that the filter fades as the number of samples grows, and the
//! filter itself uses no earlier frames. Pixels that show emissive surfaces are filtered too, apart from
//! the others: few samples of one that also shows part of a thin frame are light or dark by chance.

use girandole::glam::{IVec2, Vec2, Vec3};
use girandole::light::luminance;
use rayon::prelude::*;
use testbed::render::geometry::Geometry;
use testbed::render::image::Image;
use testbed::render::shading::View;
use testbed::scene::Scene;

/// Weights of the B3 spline.
const KERNEL: [f32; 3] = [0.375, 0.25, 0.0625];
/// For each wavelet level, the difference of luminance, in standard errors, at which the weight of a
/// neighbour falls to 1/e. The first level averages neighbours, the last reaches 2^5 pixels, where the
/// same difference is more often one of light than of noise. With 3 at all levels, the error of the
/// small scene of the tests is a third larger; with 1 at all levels, bright pixels survive on the
/// city's wet road.
const TOLERANCES: [f32; 5] = [3.0, 2.0, 1.0, 1.0, 1.0];
/// A pixel that exceeds the mean of its neighbours by this many of their standard deviations is an
/// outlier.
const OUTLIER: f32 = 2.5;
/// A pixel that exceeds the mean of its neighbours by more than this many of its own standard errors is
/// as bright as it seems.
const CERTAINTY: f32 = 4.0;
/// Specular reflectance of dielectrics, added to the albedo.
const SPECULAR: f32 = 0.04;
/// The share of the luminance of emission that is added to each of its channels, since some emit none.
const GREY: f32 = 0.05;

/// What a pixel shows. Pixels are averaged with others of their kind.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// The sky, in part at least, which is not filtered.
    Sky,
    /// Surfaces that reflect.
    Reflecting,
    /// Emissive surfaces, in part at least.
    Emissive,
}

/// What is visible in a pixel: the surface through its centre, and the mean colour through its
/// centre and four more points, so that edges between colours stay smooth.
#[derive(Clone, Copy)]
struct Guide {
    position: Vec3,
    normal: Vec3,
    /// Light is divided by this before the filter and multiplied by it afterwards: the mean colour, or emission.
    albedo: Vec3,
    /// Width of the pixel on the surface, metres.
    footprint: f32,
    kind: Kind,
}

/// The light of a pixel, divided by its albedo, and the square of the standard error of its
/// luminance.
#[derive(Clone, Copy)]
struct Sample {
    light: Vec3,
    variance: f32,
}

/// The guides of a picture.
struct Filter {
    size: IVec2,
    guides: Vec<Guide>,
}

/// A picture with less noise. `image` must show the present scene and geometry.
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
    samples = filter.map(&samples, |filter, samples, place| filter.clamp_outlier(samples, place));
    for (level, tolerance) in TOLERANCES.into_iter().enumerate() {
        // The noise of one pixel is estimated from few samples, so that it is averaged with that of
        // its neighbours.
        let variance: Vec<f32> =
            filter.map_to(&samples, |filter, samples, place| filter.smooth_variance(samples, place));
        samples = filter
            .map(&samples, |filter, samples, place| filter.smooth(samples, &variance, tolerance, place, 1 << level));
    }
    let pixels = samples
        .iter()
        .zip(&filter.guides)
        .zip(&image.pixels)
        .map(|((sample, guide), &pixel)| if guide.kind == Kind::Sky { pixel } else { sample.light * guide.albedo })
        .collect();
    Image { pixels, ..image.clone() }
}

fn guides(image: &Image, scene: &Scene, geometry: &Geometry) -> Vec<Guide> {
    let size = Vec2::new(image.width as f32, image.height as f32);
    let view = View::new(&scene.camera, image.width, image.height);
    let spread = view.up.length() * 2.0 / size.y;
    // What is hit through a place of the picture, its base colour and what it emits.
    let visible = |place: Vec2| {
        let direction = view.direction(place, size);
        let hit = geometry.nearest(view.eye, direction)?;
        let material = geometry.material(scene, &hit);
        let shines = geometry.normal(&hit).dot(direction) <= 0.0 || material.two_sided_emission;
        let scale = if shines { geometry.objects[hit.object as usize].emission_scale } else { 0.0 };
        Some((hit, material.base_color, material.emission * scale))
    };
    let guide = |index: usize| {
        let middle = Vec2::new((index % image.width as usize) as f32, (index / image.width as usize) as f32) + 0.5;
        let nothing =
            Guide { position: Vec3::ZERO, normal: Vec3::Y, albedo: Vec3::ONE, footprint: 1.0, kind: Kind::Sky };
        let Some((hit, mut color, mut emission)) = visible(middle) else { return nothing };
        for corner in [Vec2::new(-0.3, -0.3), Vec2::new(0.3, -0.3), Vec2::new(-0.3, 0.3), Vec2::new(0.3, 0.3)] {
            let Some((_, other_color, other_emission)) = visible(middle + corner) else { return nothing };
            color += other_color;
            emission += other_emission;
        }
        let (albedo, kind) = if emission == Vec3::ZERO {
            (color / 5.0 + SPECULAR, Kind::Reflecting)
        } else {
            ((emission + GREY * luminance(emission)) / 5.0, Kind::Emissive)
        };
        let direction = view.direction(middle, size);
        Guide {
            position: view.eye + direction * hit.distance,
            normal: geometry.shading_normal(&hit),
            albedo,
            footprint: hit.distance * spread,
            kind,
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

    /// Neighbours of a pixel on similar surfaces: their indices, offsets in steps, and similarities
    /// from 0 to 1.
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
            if own.kind != other.kind || own.kind == Kind::Sky {
                return None;
            }
            let off_plane = own.normal.dot(other.position - own.position).abs() / (own.footprint * step as f32);
            let facing = own.normal.dot(other.normal).max(0.0).powi(32);
            let similarity = facing * (-off_plane).exp();
            (similarity > 1e-3).then_some((index, offset, similarity))
        })
    }

    /// Reduces a pixel that is much brighter than its neighbours.
    fn clamp_outlier(&self, samples: &[Sample], place: IVec2) -> Sample {
        let own = samples[self.index(place)];
        let (mut weight, mut sum, mut square_sum) = (0.0, 0.0, 0.0);
        for (index, offset, similarity) in self.neighbours(place, 3, 1) {
            if offset != IVec2::ZERO {
                let l = luminance(samples[index].light);
                weight += similarity;
                sum += similarity * l;
                square_sum += similarity * l * l;
            }
        }
        if weight < 1.0 {
            return own;
        }
        let mean = sum / weight;
        let limit = mean + OUTLIER * (square_sum / weight - mean * mean).max(0.0).sqrt();
        let l = luminance(own.light);
        // A highlight is bright in both halves of its samples, an outlier in one.
        if l <= limit || l - mean > CERTAINTY * own.variance.max(0.0).sqrt() {
            return own;
        }
        let scale = limit / l;
        Sample { light: own.light * scale, variance: own.variance * scale * scale }
    }

    /// The mean variance of a pixel and its neighbours.
    fn smooth_variance(&self, samples: &[Sample], place: IVec2) -> f32 {
        let (mut weight, mut sum) = (1e-6, 1e-6 * samples[self.index(place)].variance);
        for (index, _, similarity) in self.neighbours(place, 2, 1) {
            weight += similarity;
            sum += similarity * samples[index].variance;
        }
        sum / weight
    }

    /// One wavelet level: the weighted mean of a pixel and its neighbours at multiples of `step`.
    /// `tolerance` is that of the level.
    fn smooth(&self, samples: &[Sample], variance: &[f32], tolerance: f32, place: IVec2, step: i32) -> Sample {
        let center = self.index(place);
        let own = luminance(samples[center].light);
        let scale = 1.0 / (tolerance * variance[center].max(0.0).sqrt() + 1e-6);
        let (mut weight_sum, mut light, mut noise) = (0.0, Vec3::ZERO, 0.0);
        for (index, offset, similarity) in self.neighbours(place, 2, step) {
            let kernel = KERNEL[offset.x.unsigned_abs() as usize] * KERNEL[offset.y.unsigned_abs() as usize];
            let difference = (luminance(samples[index].light) - own).abs() * scale;
            let weight = kernel * similarity * (-difference).exp();
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

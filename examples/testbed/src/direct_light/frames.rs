//! Draws a picture frame by frame: samplers prepare each frame, and some learn from the one before.

use super::draw::{Draw, Found, Frame};
use super::renderer::Renderer;
use crate::common::lattice::{Dimension, random};
use girandole::glam::Vec3;
use rayon::prelude::*;
use std::time::Instant;

/// The frames of a picture by one way to draw.
pub struct Frames<'a, 's> {
    renderer: &'a Renderer<'s>,
    draw: &'a mut dyn Draw,
    seed: u32,
    number: u32,
    found: Vec<Found>,
}

impl<'a, 's> Frames<'a, 's> {
    /// Lets the sampler learn for as long as it asks for.
    pub fn new(renderer: &'a Renderer<'s>, draw: &'a mut dyn Draw, seed: u32) -> Self {
        let warm_up = draw.warm_up();
        let mut frames = Self { renderer, draw, seed, number: 0, found: Vec::new() };
        let mut sums = vec![Vec3::ZERO; renderer.view.pixels.len()];
        for _ in 0..warm_up {
            frames.prepare();
            frames.draw(&mut sums, |_| true);
        }
        frames
    }

    /// Prepares the next frame. Returns the seconds of [`Draw::fold`] and of [`Draw::prepare`].
    pub fn prepare(&mut self) -> [f64; 2] {
        let frame = Frame { seed: self.seed, number: self.number, found: &self.found };
        let start = Instant::now();
        self.draw.fold(&frame);
        let folded = Instant::now();
        self.draw.prepare(&frame);
        [folded - start, folded.elapsed()].map(|time| time.as_secs_f64())
    }

    /// The way to draw the samples of the frame that was prepared, and its number.
    pub fn prepared(&self) -> (&dyn Draw, u32) {
        (self.draw, self.number)
    }

    /// Draws the frame that was prepared: adds the light of the sample of each pixel that takes part.
    pub fn draw(&mut self, sums: &mut [Vec3], takes_part: impl Fn(usize) -> bool + Sync) {
        self.found.resize(sums.len(), Found::default());
        let Self { renderer, draw, seed, number, found } = self;
        let (draw, place) = (&**draw, (*seed, *number));
        sums.par_iter_mut().zip(found.par_iter_mut()).enumerate().for_each(|(pixel, (sum, found))| {
            *found = Found::default();
            if takes_part(pixel) {
                let light;
                (light, *found) = renderer.sample(draw, pixel, place);
                *sum += light;
            }
        });
        self.number += 1;
    }
}

impl Renderer<'_> {
    /// Renders a picture, radiance in nits, row by row from the top.
    ///
    /// `samples` is the mean number of samples per pixel, at least 1. Each pixel takes the integer
    /// below or above it, with the probabilities that give this mean. Pixels of the sky take none.
    pub fn picture(&self, draw: &mut dyn Draw, samples: f64, seed: u32) -> Vec<Vec3> {
        let count = |index: usize| {
            let [rounding, ..] = random(index as u32, 0, seed, Dimension::Pixel);
            samples.floor() as u32 + u32::from(f64::from(rounding) < samples.fract())
        };
        let mut sums = vec![Vec3::ZERO; self.view.pixels.len()];
        let mut frames = Frames::new(self, draw, seed);
        for number in 0..samples.ceil() as u32 {
            frames.prepare();
            frames.draw(&mut sums, |index| number < count(index));
        }
        let mean = |(index, sum): (usize, &Vec3)| self.view.pixels[index].background + *sum / count(index) as f32;
        sums.iter().enumerate().map(mean).collect()
    }
}

//! Compares the page's picture with the sum over all lights, at the same points and with the same
//! shadow rays.
//!
//! All samples of a pixel pass through its middle and take the same point on a light, so the sum over
//! all lights is exact. That needs samples of one candidate: the points of several differ. The picture chooses a light for each sample. It is computed several times with
//! other random numbers, and its standard error follows from the spread of the results. Whole pictures
//! are compared, and their tiles.

use girandole::glam::Vec4;
use girandole::light::luminance;
use wasm_bindgen::prelude::*;

use crate::city::City;
use crate::light_list::LightList;
use crate::pipelines::Listed;

/// Pictures with random numbers of their own.
const PICTURES: u32 = 32;
/// Samples of each pixel of such a picture.
const SAMPLES: u32 = 64;
/// Lights that a dispatch adds, so that it is short.
const LIGHTS_AT_ONCE: u32 = 2_000;
/// Columns and rows of tiles.
const TILES: [u32; 2] = [4, 2];
/// The largest difference between the mean of the pictures and the sum, in standard errors.
///
/// It follows a t distribution with 31 degrees of freedom, and exceeds 5 with a probability of 2e-5.
/// With nine comparisons, fewer than one of 5,000 runs of a correct sampler fails.
const MOST_SIGMAS: f64 = 5.0;
/// The largest standard error of the tile that has the smallest one, as a share of its light: a
/// probability that is wrong by two percent exceeds `MOST_SIGMAS` there.
const MOST_ERROR: f64 = 0.003;

/// The rounding of sums, as a share of them: both add some ten thousand numbers in f32, each of which
/// rounds by 6e-8 of the sum up or down.
const ROUNDING: f64 = 1e-5;

/// Estimates of one number.
#[derive(Clone, Default)]
struct Estimates(Vec<f64>);

impl Estimates {
    fn mean(&self) -> f64 {
        self.0.iter().sum::<f64>() / self.0.len() as f64
    }

    /// The square of the standard error of the mean.
    fn variance(&self) -> f64 {
        let (mean, count) = (self.mean(), self.0.len() as f64);
        self.0.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0) / count
    }
}

/// The mean luminance of the whole picture and of its tiles.
fn tile_means(pixels: &[Vec4], [width, height]: [u32; 2], samples: u32) -> Vec<f64> {
    let of = |tile: u32| {
        let [columns, rows] = TILES;
        let is_inside = |x: u32, y: u32| tile == 0 || (x * columns / width) + columns * (y * rows / height) == tile - 1;
        let inside = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).filter(|&(x, y)| is_inside(x, y));
        let values = inside.map(|(x, y)| f64::from(luminance(pixels[(y * width + x) as usize].truncate())));
        let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
        sum / count / f64::from(samples)
    };
    (0..=TILES[0] * TILES[1]).map(of).collect()
}

#[wasm_bindgen]
impl City {
    /// Compares pictures of the present scene with sums over all lights. Returns lines for the user, of
    /// which the last is `verdict: agree` or tells what is wrong. Call nothing else meanwhile.
    pub async fn check(&mut self) -> Result<String, String> {
        let tiles = (TILES[0] * TILES[1] + 1) as usize;
        let mut pictures = vec![Estimates::default(); tiles];
        for seed in 0..PICTURES {
            let means = self.picture_means(seed).await?;
            pictures.iter_mut().zip(means).for_each(|(tile, mean)| tile.0.push(mean));
        }
        let list = LightList::new(&self.gpu.device, &self.gpu.queue, &self.stage.world);
        let sums = self.sum_means(&list).await?;
        let mut lines = format!("cells with cuts: {}\n", self.cells_with_cuts().await?);
        let (mut worst, mut least_error, mut is_close) = (0.0, f64::INFINITY, true);
        for (tile, (picture, sum)) in pictures.iter().zip(&sums).enumerate() {
            let error = picture.variance().sqrt();
            let excess = (picture.mean() - sum).abs() - ROUNDING * sum;
            let sigmas = if excess <= 0.0 { 0.0 } else { excess / error };
            // False for NaN.
            is_close &= sigmas <= MOST_SIGMAS;
            worst = f64::max(worst, sigmas);
            least_error = if error > 0.0 { least_error.min(error / sum) } else { least_error };
            let name = if tile == 0 { "whole picture".into() } else { format!("tile {tile}") };
            let mean = picture.mean();
            lines += &format!("{name}: sampled {mean:.5} ± {error:.5}, all lights {sum:.5}, {sigmas:.2} sigma\n");
        }
        lines += &if !is_close {
            format!("verdict: the sampler is wrong by {worst:.2} standard errors; {MOST_SIGMAS} are allowed")
        } else if least_error > MOST_ERROR {
            format!("verdict: no tile has an error below {MOST_ERROR} of its light; the least is {least_error:.5}")
        } else {
            "verdict: agree".into()
        };
        Ok(lines)
    }
}

impl City {
    async fn picture_means(&mut self, seed: u32) -> Result<Vec<f64>, String> {
        let mut frame = self.frame_uniform(SAMPLES, seed);
        frame.is_spread = 0;
        frame.candidates = 1;
        frame.sample_end = SAMPLES;
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.record(&mut encoder, &frame, None);
        self.gpu.queue.submit([encoder.finish()]);
        self.read_means(SAMPLES).await
    }

    async fn sum_means(&mut self, list: &LightList) -> Result<Vec<f64>, String> {
        let mut frame = self.frame_uniform(1, 0);
        while frame.sample_end < list.count {
            frame.sample_begin = frame.sample_end;
            frame.sample_end = (frame.sample_begin + LIGHTS_AT_ONCE).min(list.count);
            let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
            self.record(&mut encoder, &frame, Some((Listed::All, list)));
            self.gpu.queue.submit([encoder.finish()]);
        }
        self.read_means(1).await
    }

    /// How many cells of the last picture have cuts.
    async fn cells_with_cuts(&self) -> Result<u32, String> {
        let report = self.lights.cut_report().ok_or("The device is lost.")?;
        // Words 5 and 6 are `CutReport::built` and `CutReport::kept`.
        let words: Vec<u32> = self.gpu.read(report, 7).await?;
        Ok(words[5] + words[6])
    }

    async fn read_means(&self, samples: u32) -> Result<Vec<f64>, String> {
        let size = self.picture.size;
        let pixels: Vec<Vec4> = self.gpu.read(&self.picture.sums, u64::from(size[0] * size[1])).await?;
        Ok(tile_means(&pixels, size, samples))
    }
}

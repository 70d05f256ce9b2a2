//! The time that each stage of a sample takes.

use super::draw::{Draw, Sample};
use super::frames::Frames;
use super::renderer::Renderer;
use super::rivals::FULL_HD;
use super::view::{Pixel, SUBPIXELS, Surface};
use std::time::Instant;

/// Ways to draw take turns for this many rounds, and the fastest round of each stage counts, for each
/// part of the samples: moments in which the machine is busy do not.
const ROUNDS: usize = 15;
/// The samples of a part. It takes less time than a busy machine gives to a thread at once.
const PART: usize = 250;
/// The first rounds, in which preparing a frame is timed.
const PREPARING_ROUNDS: usize = 4;
/// The random numbers of the rounds.
const TIMING_SEED: u32 = 3;

/// The seconds that each stage of one sample takes on one thread, as means over the samples of a
/// picture.
#[derive(Clone, Copy, Debug)]
pub struct StageTimes {
    /// Drawing a light and a point on it, learning what its shadow ray finds, and its share of what the sampler
    /// prepares for a frame.
    pub choosing: f64,
    /// Shadow rays, which only samples that reflect light need.
    pub shadow_rays: f64,
    /// The BRDF and the product of all factors.
    pub shading: f64,
}

impl StageTimes {
    const UNKNOWN: Self = Self { choosing: f64::INFINITY, shadow_rays: f64::INFINITY, shading: f64::INFINITY };

    /// All times multiplied by a factor.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            choosing: self.choosing * factor,
            shadow_rays: self.shadow_rays * factor,
            shading: self.shading * factor,
        }
    }

    /// The time of a whole sample.
    pub fn total(&self) -> f64 {
        self.choosing + self.shadow_rays + self.shading
    }
}

impl Renderer<'_> {
    /// Measures the time of each stage for each way to draw, at one sample of about `count` pixels
    /// that are spread over the picture. Samplers that learn have learnt.
    pub fn stage_times(&self, draws: &mut [&mut dyn Draw], count: usize) -> Vec<StageTimes> {
        let is_full = |(_, pixel): &(usize, &Pixel)| pixel.surfaces.iter().all(Option::is_some);
        let full: Vec<(usize, &Pixel)> = self.view.pixels.iter().enumerate().filter(is_full).collect();
        let step = (full.len() / count.max(1)).max(1);
        let timed: Vec<(usize, &Surface)> = full
            .iter()
            .step_by(step)
            .filter_map(|(index, pixel)| Some((*index, pixel.surfaces[index % SUBPIXELS].as_ref()?)))
            .collect();
        // Samplers prepare on all threads, but here on one.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().ok();
        let parts: Vec<&[(usize, &Surface)]> = timed.chunks(PART).collect();
        let mut fastest = vec![vec![StageTimes::UNKNOWN; parts.len()]; draws.len()];
        let mut preparing = vec![f64::INFINITY; draws.len()];
        let pixels = full.len() as f64;
        let shares: Vec<f64> = draws.iter().map(|draw| draw.samples_per_preparation(pixels)).collect();
        let mut frames: Vec<Frames<'_, '_>> =
            draws.iter_mut().map(|draw| Frames::new(self, *draw, TIMING_SEED)).collect();
        for round in 0..ROUNDS {
            for (i, (frames, fastest)) in frames.iter_mut().zip(&mut fastest).enumerate() {
                if round < PREPARING_ROUNDS {
                    let [folding, rest] = match &pool {
                        Some(pool) => pool.install(|| frames.prepare()),
                        None => frames.prepare(),
                    };
                    preparing[i] = preparing[i].min(folding / pixels.max(FULL_HD) + rest / shares[i]);
                }
                for (part, fastest) in parts.iter().zip(fastest) {
                    self.time_part(frames.prepared(), part, round as u32, fastest);
                }
            }
        }
        let whole = |(parts, preparing): (Vec<StageTimes>, f64)| {
            let sum = |stage: fn(&StageTimes) -> f64| parts.iter().map(stage).sum::<f64>() / timed.len().max(1) as f64;
            StageTimes {
                choosing: sum(|times| times.choosing) + preparing,
                shadow_rays: sum(|times| times.shadow_rays),
                shading: sum(|times| times.shading),
            }
        };
        fastest.into_iter().zip(preparing).map(whole).collect()
    }

    /// Draws a part of the samples, and keeps the seconds of each stage that is faster than before. They are drawn
    /// once before that: in a frame of 1920 x 1080 pixels nearly all samples find in caches what their
    /// neighbours have read.
    fn time_part(
        &self,
        (draw, frame): (&dyn Draw, u32),
        part: &[(usize, &Surface)],
        round: u32,
        fastest: &mut StageTimes,
    ) {
        let (mut drawn, mut lit) = (Vec::with_capacity(PART), Vec::with_capacity(PART));
        let mut start = Instant::now();
        for _ in 0..2 {
            drawn.clear();
            start = Instant::now();
            for (index, surface) in part {
                let pixel = *index as u32;
                let sample = Sample { pixel, frame, u: (self.numbers)(pixel, round, TIMING_SEED) };
                drawn.push((sample, draw.draw(surface, self.material(surface), &sample)));
            }
        }
        let chosen = Instant::now();
        for ((_, surface), (_, drawn)) in part.iter().zip(&drawn) {
            let light = drawn.as_ref().map(|drawn| self.reflected(surface, &drawn.incident) * drawn.weight);
            lit.push(light.unwrap_or_default());
        }
        let shaded = Instant::now();
        let mut found = Vec::with_capacity(PART);
        for (((_, surface), (sample, drawn)), light) in part.iter().zip(&drawn).zip(&lit) {
            if let Some(drawn) = drawn.as_ref().filter(|_| light.max_element() > 0.0) {
                found.push((surface, sample, drawn, !self.is_shadowed(surface, &drawn.incident)));
            }
        }
        let traced = Instant::now();
        for (surface, sample, drawn, is_visible) in found {
            draw.learn(surface, sample, drawn, is_visible);
        }
        fastest.choosing = fastest.choosing.min((chosen - start + traced.elapsed()).as_secs_f64());
        fastest.shading = fastest.shading.min((shaded - chosen).as_secs_f64());
        fastest.shadow_rays = fastest.shadow_rays.min((traced - shaded).as_secs_f64());
    }
}

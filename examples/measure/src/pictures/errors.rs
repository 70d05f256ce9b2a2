//! The errors of pictures with one setting.

use girandole::glam::Vec3;
use girandole::{LightId, LightSampler};
use rayon::prelude::*;
use std::time::{Duration, Instant};
use testbed::direct_light::draw::Draw;
use testbed::direct_light::renderer::Renderer;
use testbed::direct_light::times::StageTimes;
use testbed::measuring::score::{Estimate, Score};

/// The sum over all lights is timed with the n-th part of the evaluations of a picture.
const TIMED_PART: usize = 8;
/// Seeds of pictures begin here; those of the reference are above.
const FIRST_SEED: u32 = 0;

/// The errors of several pictures that differ in their random numbers.
#[derive(Clone, Copy, Debug)]
pub struct Errors {
    pub rel_mse: Estimate,
    pub mape: Estimate,
    /// The mean luminance relative to that of the reference.
    pub mean: Estimate,
}

impl Errors {
    fn new(scores: &[Score]) -> Self {
        let estimate = |value: fn(&Score) -> f64| Estimate::new(&scores.iter().map(value).collect::<Vec<_>>());
        Self {
            rel_mse: estimate(|score| score.rel_mse),
            mape: estimate(|score| score.mape),
            mean: estimate(|score| score.mean),
        }
    }
}

/// Renders pictures with `samples` per pixel and compares them with the reference. Returns the
/// first picture as well.
pub fn errors(
    renderer: &Renderer<'_>,
    draw: &mut dyn Draw,
    samples: f64,
    pictures: u32,
    reference: &[Vec3],
) -> (Errors, Vec<Vec3>) {
    let mut first = Vec::new();
    let scores: Vec<Score> = (FIRST_SEED..FIRST_SEED + pictures)
        .map(|seed| {
            let picture = renderer.picture(draw, samples, seed);
            let score = Score::new(&picture, reference);
            if seed == FIRST_SEED {
                first = picture;
            }
            score
        })
        .collect();
    (Errors::new(&scores), first)
}

/// The errors of the sum over all lights with one sample per pixel, at pixels that are spread over
/// the picture.
pub fn errors_of_all(
    renderer: &Renderer<'_>,
    (lights, ids): (&LightSampler<'_>, &[LightId]),
    (pictures, most_evaluations): (u32, usize),
    reference: &[Vec3],
) -> Errors {
    let pixels = spread(reference.len(), most_evaluations / ids.len().max(1));
    let of_pixels: Vec<Vec3> = pixels.iter().map(|index| reference[*index]).collect();
    let score = |seed| {
        let one = |index: &usize| renderer.pixel_by_all(lights, ids, *index, (1, seed));
        Score::new(&pixels.par_iter().map(one).collect::<Vec<_>>(), &of_pixels)
    };
    Errors::new(&(FIRST_SEED..FIRST_SEED + pictures).map(score).collect::<Vec<_>>())
}

/// The time of a sum over all lights on one thread. `unshadowed` renders the same without shadow
/// rays.
pub fn times_of_all(
    renderer: &Renderer<'_>,
    unshadowed: &Renderer<'_>,
    (lights, ids): (&LightSampler<'_>, &[LightId]),
    most_evaluations: usize,
) -> StageTimes {
    let is_shaded = |index: &usize| renderer.view.pixels[*index].surfaces.iter().all(Option::is_some);
    let shaded: Vec<usize> = (0..renderer.view.pixels.len()).filter(is_shaded).collect();
    let timed = spread(shaded.len(), most_evaluations / TIMED_PART / ids.len().max(1));
    let seconds = |renderer: &Renderer<'_>| {
        let start = Instant::now();
        for index in &timed {
            std::hint::black_box(renderer.pixel_by_all(lights, ids, shaded[*index], (1, FIRST_SEED)));
        }
        start.elapsed().max(Duration::from_nanos(1)).as_secs_f64() / timed.len().max(1) as f64
    };
    let (shading, whole) = (seconds(unshadowed), seconds(renderer));
    StageTimes { choosing: 0.0, shadow_rays: (whole - shading).max(0.0), shading }
}

/// At most `count` (at least one) of the numbers below `all`, evenly spread.
fn spread(all: usize, count: usize) -> Vec<usize> {
    (0..all).step_by(all.div_ceil(count.max(1)).max(1)).collect()
}

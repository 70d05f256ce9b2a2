//! The time of one choice, on one thread.

use super::effort::Effort;
use girandole::ShadingPoint;
use std::hint::black_box;
use std::time::Instant;
use testbed::measuring::samplers::Chooser;
use testbed::scene::rng::Rng;

/// Samplers take turns for this many rounds, and the fastest round counts: moments in which the
/// machine is busy do not.
const ROUNDS: usize = 25;
/// Choices of one sampler in a round.
const CHOICES: usize = 8_000;

/// Nanoseconds per choice of each sampler, all at the same shading points and with the same random
/// numbers.
pub fn nanoseconds(choosers: &[Chooser<'_>], shading_points: &[ShadingPoint], effort: Effort) -> Vec<f64> {
    let (rounds, choices) = effort.select((ROUNDS, CHOICES), (1, 100));
    let mut rng = Rng::new(7, 0);
    // Consecutive choices are for different shading points, as between the pixels of a wide view.
    let inputs: Vec<(ShadingPoint, [f32; 2])> =
        (0..choices).map(|i| (shading_points[i % shading_points.len()], [rng.unit(), rng.unit()])).collect();
    let mut fastest = vec![f64::INFINITY; choosers.len()];
    for _ in 0..rounds {
        for (chooser, fastest) in choosers.iter().zip(&mut fastest) {
            let start = Instant::now();
            for (shading_point, u) in &inputs {
                black_box(chooser.choose(shading_point, *u));
            }
            *fastest = fastest.min(start.elapsed().as_secs_f64() * 1.0e9 / choices as f64);
        }
    }
    fastest
}

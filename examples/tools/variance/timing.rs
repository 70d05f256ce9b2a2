//! Time of one draw, on one thread.

use super::samplers::Chooser;
use super::scene::rng::Rng;
use girandole::ShadingPoint;
use std::hint::black_box;
use std::time::Instant;

/// Samplers take turns for this many rounds; the fastest counts, so that a busy moment of the machine does not.
const ROUNDS: usize = 25;
/// Draws of a round.
const DRAWS: usize = 8_000;

/// Nanoseconds a draw of each sampler, each with the same shading points and random numbers.
pub fn nanoseconds(choosers: &[Box<dyn Chooser + '_>], shading_points: &[ShadingPoint]) -> Vec<f64> {
    let mut rng = Rng::new(7, 0);
    // Neighbouring draws are of different shading points, as between the pixels of a wide view.
    let draws: Vec<(ShadingPoint, [f32; 2])> =
        (0..DRAWS).map(|i| (shading_points[i % shading_points.len()], [rng.unit(), rng.unit()])).collect();
    let mut fastest = vec![f64::INFINITY; choosers.len()];
    for _ in 0..ROUNDS {
        for (chooser, fastest) in choosers.iter().zip(&mut fastest) {
            let start = Instant::now();
            for (shading_point, u) in &draws {
                black_box(chooser.draw(shading_point, *u));
            }
            *fastest = fastest.min(start.elapsed().as_secs_f64() * 1.0e9 / DRAWS as f64);
        }
    }
    fastest
}

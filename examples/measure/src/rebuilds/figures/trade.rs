//! Lights that trade places. Each flies from one place to the next in its own rhythm.

use girandole::glam::Vec3;
use testbed::scene::rng::Rng;

/// The number of assignments of lights to places, which follow each other in a cycle.
const ASSIGNMENTS: usize = 6;

/// The places, and the lights that take them over time.
pub struct Trade {
    places: Vec<Vec3>,
    /// The place of each light in each assignment; in the first, each light has its own.
    assignments: Vec<Vec<u32>>,
    /// The time from one place to the next, in seconds.
    duration: f32,
    /// When each light starts, as a share of the duration.
    delays: Vec<f32>,
}

impl Trade {
    /// Lets a random `share` of the lights trade places.
    pub fn new(places: Vec<Vec3>, share: f32, duration: f32, rng: &mut Rng) -> Self {
        let movers: Vec<usize> = (0..places.len()).filter(|_| rng.chance(share)).collect();
        let mut assignments: Vec<Vec<u32>> = vec![(0..places.len() as u32).collect(); ASSIGNMENTS];
        for assignment in &mut assignments[1..] {
            for i in 1..movers.len() {
                assignment.swap(movers[i], movers[rng.below(i + 1)]);
            }
        }
        let delays = (0..places.len()).map(|_| rng.unit()).collect();
        Self { places, assignments, duration, delays }
    }

    /// The number of lights.
    pub fn count(&self) -> usize {
        self.places.len()
    }

    /// The position of a light.
    pub fn place(&self, light: usize, time: f32) -> Vec3 {
        let trades = (time / self.duration - self.delays[light]).max(0.0);
        let (index, t) = (trades as usize, trades.fract());
        let at = |index: usize| self.places[self.assignments[index % ASSIGNMENTS][light] as usize];
        at(index).lerp(at(index + 1), t * t * (3.0 - 2.0 * t))
    }
}

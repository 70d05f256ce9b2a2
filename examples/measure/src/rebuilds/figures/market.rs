//! Market stalls whose lamps are rearranged; some are carried from stall to stall.

use super::figure::{Figure, size};
use super::trade::Trade;
use girandole::glam::{Vec3, vec3};
use testbed::scene::rng::Rng;

/// The distance between stalls, in metres.
const AISLE: f32 = 3.5;

/// Lamps under the roofs of stalls.
pub struct Market {
    trade: Trade,
}

impl Market {
    /// Stalls in rows, with four to twelve lamps each.
    pub fn new(rng: &mut Rng) -> Self {
        let lamps = 4 + rng.below(9);
        let stalls = size(rng, 8.0, 60.0);
        let side = (stalls as f32).sqrt().ceil() as usize;
        let mut places = Vec::with_capacity(stalls * lamps);
        for stall in 0..stalls {
            let middle =
                vec3((stall % side) as f32, 0.0, (stall / side) as f32) - vec3(1.0, 0.0, 1.0) * (0.5 * side as f32);
            for _ in 0..lamps {
                places.push(middle * AISLE + vec3(rng.range(-1.1, 1.1), rng.range(2.1, 2.7), rng.range(-1.1, 1.1)));
            }
        }
        let share = if rng.chance(0.4) { rng.range(0.0, 0.1) } else { rng.range(0.2, 0.9) };
        let duration = rng.range(1.5, 3.5);
        Self { trade: Trade::new(places, share, duration, rng) }
    }
}

impl Figure for Market {
    fn count(&self) -> usize {
        self.trade.count()
    }

    fn place(&self, light: usize, time: f32) -> Vec3 {
        let sway = 0.03 * (2.3 * time + light as f32).sin();
        self.trade.place(light, time) + vec3(sway, 0.0, 0.6 * sway)
    }
}

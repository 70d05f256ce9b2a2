//! Lights that trade places: each flies from one place to the next, in its own rhythm, and all places stay taken.

use super::super::scene::rng::Rng;
use girandole::glam::Vec3;

/// Deals of the places, one after the other and then from the first again.
const DEALS: usize = 6;

/// Places and who takes them when.
pub struct Trade {
    places: Vec<Vec3>,
    /// Whose place each light has in each deal; its own in the first.
    deals: Vec<Vec<u32>>,
    /// Seconds from one place to the next.
    duration: f32,
    /// When each light sets out, as a share of that.
    delays: Vec<f32>,
}

impl Trade {
    /// `share` of the lights trade.
    pub fn new(places: Vec<Vec3>, share: f32, duration: f32, rng: &mut Rng) -> Self {
        let movers: Vec<usize> = (0..places.len()).filter(|_| rng.chance(share)).collect();
        let mut deals: Vec<Vec<u32>> = vec![(0..places.len() as u32).collect(); DEALS];
        for deal in &mut deals[1..] {
            for i in 1..movers.len() {
                deal.swap(movers[i], movers[rng.below(i + 1)]);
            }
        }
        let delays = (0..places.len()).map(|_| rng.unit()).collect();
        Self { places, deals, duration, delays }
    }

    pub fn count(&self) -> usize {
        self.places.len()
    }

    pub fn place(&self, light: usize, time: f32) -> Vec3 {
        let trades = (time / self.duration - self.delays[light]).max(0.0);
        let (deal, t) = (trades as usize, trades.fract());
        let at = |deal: usize| self.places[self.deals[deal % DEALS][light] as usize];
        at(deal).lerp(at(deal + 1), t * t * (3.0 - 2.0 * t))
    }
}

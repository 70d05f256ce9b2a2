//! What arrives at receivers in a frame: the same for all strategies, so that only chances are left to look at.

use super::lights::contributions;
use girandole::{LightId, Receiver, World};
use rayon::prelude::*;

/// The dimmest lights are left out as long as all that are bring less than this share of a receiver's light together.
const DIM_SHARE: f64 = 1.0e-4;

/// One frame's light at each receiver.
pub struct Lit(Vec<At>);

/// At one receiver.
struct At {
    /// Lux, by all lights.
    total: f64,
    /// Which light of all, in the order of [`girandole::Sampler::all_lights`], and lux.
    lights: Vec<(u32, f32)>,
}

/// Noise and chances at one receiver.
pub struct Chances<'a> {
    /// Relative standard deviation of one sample; 0 where nothing shines.
    pub sigma: f64,
    /// Lux, by all lights.
    pub total: f64,
    /// Which light of all, and lux; without the dimmest.
    pub lights: &'a [(u32, f32)],
    /// Of all lights.
    pub chances: &'a [f32],
}

impl Lit {
    /// O(lights) a receiver, receivers in parallel.
    pub fn new(world: &World, receivers: &[Receiver]) -> Self {
        let sampler = world.sampler();
        let all: Vec<LightId> = sampler.all_lights().collect();
        let at = |receiver: &Receiver| {
            let lux = contributions(&sampler, &all, receiver);
            let total: f64 = lux.iter().map(|lux| f64::from(*lux)).sum();
            let mut lights: Vec<(u32, f32)> = (0..).zip(lux).filter(|(_, lux)| *lux > 0.0).collect();
            lights.sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
            let mut left = total;
            let keep = lights.iter().take_while(|(_, lux)| {
                let keeps = left > DIM_SHARE * total;
                left -= f64::from(*lux);
                keeps
            });
            let kept = keep.count();
            lights.truncate(kept);
            lights.shrink_to_fit();
            lights.sort_unstable_by_key(|(light, _)| *light);
            At { total, lights }
        };
        Self(receivers.par_iter().map(at).collect())
    }

    /// Something of the noise and chances at each receiver, of a world in the same frame.
    pub fn look<T: Send>(
        &self,
        world: &World,
        receivers: &[Receiver],
        see: impl Fn(usize, &Chances<'_>) -> T + Sync,
    ) -> Vec<T> {
        let sampler = world.sampler();
        let at = |chances: &mut Vec<f32>, (index, (receiver, At { total, lights })): (usize, (&Receiver, &At))| {
            sampler.distribution(receiver, chances);
            // As in `sigma.rs` of the variance example.
            let part = |(light, lux): &(u32, f32)| f64::from(*lux).powi(2) / f64::from(chances[*light as usize]);
            let second: f64 = lights.iter().map(part).sum();
            let sigma = if *total > 0.0 { (second / (total * total) - 1.0).max(0.0).sqrt() } else { 0.0 };
            see(index, &Chances { sigma, total: *total, lights, chances })
        };
        receivers.par_iter().zip(&self.0).enumerate().map_init(Vec::new, at).collect()
    }

    /// Mean over receivers of the relative standard deviation of one sample, of a world in the same frame.
    pub fn sigma(&self, world: &World, receivers: &[Receiver]) -> f64 {
        self.look(world, receivers, |_, at| at.sigma).iter().sum::<f64>() / receivers.len().max(1) as f64
    }
}

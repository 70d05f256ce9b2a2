//! What arrives at shading points in a frame: the same for all strategies, so that only chances are left to look at.

use super::lights::contributions;
use girandole::{LightId, LightWorld, ShadingPoint};
use rayon::prelude::*;

/// The dimmest lights are left out as long as all that are bring less than this share of a shading point's light together.
const DIM_SHARE: f64 = 1.0e-4;

/// One frame's light at each shading point.
pub struct Lit(Vec<At>);

/// At one shading point.
struct At {
    /// Lux, by all lights.
    total: f64,
    /// Which light of all, in the order of [`girandole::LightSampler::all_lights`], and lux.
    lights: Vec<(u32, f32)>,
}

/// Noise and chances at one shading point.
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
    /// O(lights) a shading point, shading points in parallel.
    pub fn new(world: &LightWorld, shading_points: &[ShadingPoint]) -> Self {
        let sampler = world.sampler();
        let all: Vec<LightId> = sampler.all_lights().collect();
        let at = |shading_point: &ShadingPoint| {
            let lux = contributions(&sampler, &all, shading_point);
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
        Self(shading_points.par_iter().map(at).collect())
    }

    /// Something of the noise and chances at each shading point, of a world in the same frame.
    pub fn look<T: Send>(
        &self,
        world: &LightWorld,
        shading_points: &[ShadingPoint],
        see: impl Fn(usize, &Chances<'_>) -> T + Sync,
    ) -> Vec<T> {
        let sampler = world.sampler();
        let at = |chances: &mut Vec<f32>,
                  (index, (shading_point, At { total, lights })): (usize, (&ShadingPoint, &At))| {
            sampler.distribution(shading_point, chances);
            // As in `sigma.rs` of the variance example.
            let part = |(light, lux): &(u32, f32)| f64::from(*lux).powi(2) / f64::from(chances[*light as usize]);
            let second: f64 = lights.iter().map(part).sum();
            let sigma = if *total > 0.0 { (second / (total * total) - 1.0).max(0.0).sqrt() } else { 0.0 };
            see(index, &Chances { sigma, total: *total, lights, chances })
        };
        shading_points.par_iter().zip(&self.0).enumerate().map_init(Vec::new, at).collect()
    }

    /// Mean over shading points of the relative standard deviation of one sample, of a world in the same frame.
    pub fn sigma(&self, world: &LightWorld, shading_points: &[ShadingPoint]) -> f64 {
        self.look(world, shading_points, |_, at| at.sigma).iter().sum::<f64>() / shading_points.len().max(1) as f64
    }
}
